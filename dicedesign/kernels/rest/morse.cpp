#include "rest/morse.hpp"

#include "rest/lines.hpp"

namespace dicedesign {
namespace {

// Where bodies roll that are let go on facets; every answer is found once.
class Destinations {
public:
    Destinations(const Frame<double>& frame, const Elements& elements)
        : frame_(frame), elements_(elements), known_(frame.hull.facet_count, -1) {}

    // The stable facet on which a body comes to rest that is let go on a facet.
    Verdict find(Index facet, Index& rest) {
        way_.clear();
        Index current = facet;
        while (known_[current] < 0) {
            if (elements_.stable[current]) {
                known_[current] = current;
                break;
            }
            // Facets that are flat within a tolerance can seem to roll in a circle.
            if (static_cast<Index>(way_.size()) > frame_.hull.facet_count) {
                return Verdict::uncertain;
            }
            way_.push_back(current);
            const Index e = elements_.roll_edge[current];
            if (e >= 0) {
                current = frame_.hull.facet[frame_.hull.twin[e]];
                continue;
            }
            const Verdict verdict = descend(frame_, elements_, current, current);
            if (verdict != Verdict::certain) return verdict;
        }
        rest = known_[current];
        for (const Index passed : way_) known_[passed] = rest;
        return Verdict::certain;
    }

private:
    const Frame<double>& frame_;
    const Elements& elements_;
    std::vector<Index> known_, way_;
};

}  // namespace

Verdict find_destinations(const Hull& hull, const Vec& center, const Tolerances& tolerances,
                          const Index* facets, Index count, std::vector<Index>& reached) {
    const Frame<double> frame(hull, center, tolerances);
    Elements elements;
    Verdict verdict = classify(frame, elements);
    Destinations destinations(frame, elements);
    reached.assign(count, -1);
    for (Index i = 0; i < count && verdict == Verdict::certain; ++i) {
        verdict = destinations.find(facets[i], reached[i]);
    }
    return verdict;
}

Verdict find_separatrices(const Hull& hull, const Vec& center, const Tolerances& tolerances,
                          Elements& elements, Separatrices& found) {
    const Frame<double> frame(hull, center, tolerances);
    Verdict verdict = classify(frame, elements);
    if (verdict != Verdict::certain) return verdict;
    std::vector<Index> number(hull.facet_count, -1);
    for (Index f = 0; f < hull.facet_count; ++f) {
        if (!elements.stable[f]) continue;
        number[f] = static_cast<Index>(found.rests.size());
        found.rests.push_back(f);
    }
    found.branch_start.push_back(0);
    if (found.rests.size() == 1) return Verdict::certain;
    Destinations destinations(frame, elements);
    for (Index e = 0; e < hull.half_edge_count(); ++e) {
        const Index twin = hull.twin[e];
        if (e > twin || !elements.saddle(hull, e)) continue;
        Index left = -1, right = -1;
        verdict = destinations.find(hull.facet[e], left);
        if (verdict != Verdict::certain) return verdict;
        verdict = destinations.find(hull.facet[twin], right);
        if (verdict != Verdict::certain) return verdict;
        if (left == right) continue;
        found.saddles.push_back(e);
        found.basins.insert(found.basins.end(), {number[left], number[right]});
        found.saddle_ends.insert(found.saddle_ends.end(), {hull.tail[e], hull.head[e]});
    }
    std::vector<Index> crossed;
    for (const Index e : found.saddles) {
        for (const Index end : {hull.head[e], hull.tail[e]}) {
            Index maximum = -1;
            verdict = ascend(frame, elements, e, end, crossed, maximum);
            if (verdict != Verdict::certain) return verdict;
            found.branch_start.push_back(static_cast<Index>(crossed.size()));
            found.maxima.push_back(maximum);
        }
    }
    found.crossings.reserve(2 * crossed.size());
    for (const Index e : crossed) {
        found.crossings.insert(found.crossings.end(), {hull.tail[e], hull.head[e]});
    }
    return Verdict::certain;
}

}  // namespace dicedesign
