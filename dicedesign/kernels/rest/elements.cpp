#include "rest/elements.hpp"

namespace dicedesign {
namespace {

struct Bounded {
    double value, bound;
};

// r_p . (x_q - x_p) of a half-edge.
template <class Real>
Bounded growth(const Frame<Real>& frame, Index e) {
    const Vector<Real> r = frame.radius(frame.hull.tail[e]), v = frame.edge(e);
    return {rounded(dot(r, v)), frame.rounding * dot(absolute(rounded(r)), absolute(rounded(v)))};
}

// Distance of the foot of c on the facet's plane from the edge's line, times the edge's length.
template <class Real>
Bounded side(const Frame<Real>& frame, Index e) {
    const Index f = frame.hull.facet[e];
    const Vector<Real> r = frame.radius(frame.hull.tail[e]), v = frame.edge(e);
    const Vector<Real> n = frame.normal(f);
    const double error = frame.normal_error(f);
    const Vec a = absolute(rounded(r)), b = absolute(rounded(v));
    const Vec m = absolute(rounded(n)) + Vec{error, error, error};
    const double spread = 2.0 * sum(b) * error;
    const Vec across{b.y * m.z + b.z * m.y, b.z * m.x + b.x * m.z, b.x * m.y + b.y * m.x};
    const double bound = a.x * (frame.rounding * across.x + spread) +
                         a.y * (frame.rounding * across.y + spread) +
                         a.z * (frame.rounding * across.z + spread);
    return {rounded(dot(r, cross(v, n))), bound};
}

// The sign of a value of a half-edge, which `coarse(e)` gives in doubles and `fine(e)` in twofold
// numbers, where doubles do not decide. A move of c by a length changes it by at most this length
// times the edge's length. Twofold values need no such move: ties are looked for in doubles.
template <class Coarse, class Fine>
Verdict sign(const Coarse& coarse, const Fine& fine, const Frame<double>& frame, Index e,
             Index& result) {
    Bounded number = coarse(e);
    if (frame.tolerances.tie_distance > 0.0) {
        const double reach = number.bound + frame.tolerances.tie_distance * norm(frame.edge(e));
        if (!(std::fabs(number.value) > reach)) return Verdict::tied;
    } else if (!(std::fabs(number.value) > number.bound)) {
        number = fine(e);
        if (!(std::fabs(number.value) > number.bound)) return Verdict::uncertain;
    }
    result = number.value > 0.0 ? 1 : -1;
    return Verdict::certain;
}

// The edge that a body rolls over which stands on a facet: a hinge with the foot of c outside; of
// several, which only facets flat within a tolerance can have, the farthest.
Index roll_edge(const Frame<double>& frame, const Elements& elements, Index facet) {
    Index chosen = -1;
    double farthest = 0.0;
    for (Index e = frame.hull.facet_start[facet]; e < frame.hull.facet_start[facet + 1]; ++e) {
        if (elements.side_sign[e] > 0 || !elements.hinge[e]) continue;
        const double outside = -side(frame, e).value / norm(frame.edge(e));
        if (chosen < 0 || outside >= farthest) {
            chosen = e;
            farthest = outside;
        }
    }
    return chosen;
}

}  // namespace

Verdict classify(const Frame<double>& frame, Elements& elements) {
    const Hull& hull = frame.hull;
    const Frame<Twofold> finer = frame.with<Twofold>();
    elements.growth_sign.resize(hull.half_edge_count());
    elements.side_sign.resize(hull.half_edge_count());
    elements.ascending.resize(hull.half_edge_count());
    elements.descending.resize(hull.half_edge_count());
    elements.hinge.resize(hull.half_edge_count());
    elements.maximum.assign(hull.vertex_count, 1);
    elements.stable.assign(hull.facet_count, 1);
    elements.roll_edge.assign(hull.facet_count, -1);
    const auto coarse_growth = [&](Index e) { return growth(frame, e); };
    const auto fine_growth = [&](Index e) { return growth(finer, e); };
    const auto coarse_side = [&](Index e) { return side(frame, e); };
    const auto fine_side = [&](Index e) { return side(finer, e); };
    for (Index e = 0; e < hull.half_edge_count(); ++e) {
        Verdict verdict =
            sign(coarse_growth, fine_growth, frame, e, elements.growth_sign[e]);
        if (verdict != Verdict::certain) return verdict;
        verdict = sign(coarse_side, fine_side, frame, e, elements.side_sign[e]);
        if (verdict != Verdict::certain) return verdict;
        elements.ascending[e] = elements.growth_sign[e] > 0;
        elements.descending[e] = elements.growth_sign[e] < 0;
        if (elements.ascending[e]) elements.maximum[hull.tail[e]] = 0;
        if (elements.side_sign[e] < 0) elements.stable[hull.facet[e]] = 0;
    }
    for (Index e = 0; e < hull.half_edge_count(); ++e) {
        elements.hinge[e] = elements.descending[e] && elements.descending[hull.twin[e]];
    }
    for (Index f = 0; f < hull.facet_count; ++f) {
        if (!elements.stable[f]) elements.roll_edge[f] = roll_edge(frame, elements, f);
    }
    return Verdict::certain;
}

Index roll_vertex(const Frame<double>& frame, const Elements& elements, Index facet) {
    Index chosen = -1;
    double least = 0.0;
    bool known = false;
    for (Index e = frame.hull.facet_start[facet]; e < frame.hull.facet_start[facet + 1]; ++e) {
        const Vec r = frame.radius(frame.hull.tail[e]);
        const double squared = dot(r, r);
        // Distance grows from the nearest one along both sides, which is known exactly.
        const bool is_least = elements.ascending[e] &&
                              elements.ascending[frame.hull.twin[frame.hull.previous[e]]];
        if (chosen < 0 || is_least > known || (is_least == known && squared < least)) {
            chosen = frame.hull.tail[e];
            least = squared;
            known = is_least;
        }
    }
    return chosen;
}

}  // namespace dicedesign
