#include "surface/surface.hpp"

#include <algorithm>

namespace dicedesign {
namespace {

// One use of an edge by a triangle.
struct Use {
    Index high;  // the end with the higher number
    Index triangle;
    bool upward;  // whether it runs toward that end
};

// Calls a function with the uses of each edge, as a range.
template <class Visit>
void visit_edges(const Index* triangles, Index count, Index points, Visit visit) {
    std::vector<Index> start(points + 1, 0);
    const auto low_end = [&](Index k) {
        return std::min(triangles[k], triangles[k % 3 == 2 ? k - 2 : k + 1]);
    };
    for (Index k = 0; k < 3 * count; ++k) ++start[low_end(k) + 1];
    for (Index p = 0; p < points; ++p) start[p + 1] += start[p];
    std::vector<Use> uses(3 * count);
    std::vector<Index> filled(start.begin(), start.end() - 1);
    for (Index k = 0; k < 3 * count; ++k) {
        const Index tail = triangles[k], head = triangles[k % 3 == 2 ? k - 2 : k + 1];
        uses[filled[std::min(tail, head)]++] = {std::max(tail, head), k / 3, tail < head};
    }
    for (Index p = 0; p < points; ++p) {
        const auto begin = uses.begin() + start[p], end = uses.begin() + start[p + 1];
        std::sort(begin, end, [](const Use& a, const Use& b) { return a.high < b.high; });
        for (auto first = begin; first != end;) {
            const auto last = std::find_if(
                first, end, [&](const Use& use) { return use.high != first->high; });
            visit(first, last);
            first = last;
        }
    }
}

// The representative of a set of triangles.
Index root(std::vector<Index>& parent, Index t) {
    while (parent[t] != t) {
        parent[t] = parent[parent[t]];
        t = parent[t];
    }
    return t;
}

}  // namespace

bool is_closed(const Index* triangles, Index count, Index points) {
    bool closed = count > 0;
    visit_edges(triangles, count, points, [&](auto first, auto last) {
        Index balance = 0;
        for (auto use = first; use != last; ++use) balance += use->upward ? 1 : -1;
        closed = closed && balance == 0;
    });
    return closed;
}

std::vector<Index> shells(const Index* triangles, Index count, Index points) {
    std::vector<Index> parent(count);
    for (Index t = 0; t < count; ++t) parent[t] = t;
    visit_edges(triangles, count, points, [&](auto first, auto last) {
        for (auto use = first + 1; use != last; ++use) {
            const Index a = root(parent, first->triangle), b = root(parent, use->triangle);
            // The first triangle of a set stands for it.
            parent[std::max(a, b)] = std::min(a, b);
        }
    });
    std::vector<Index> number(count);
    Index found = 0;
    for (Index t = 0; t < count; ++t) {
        const Index first = root(parent, t);
        number[t] = first == t ? found++ : number[first];
    }
    return number;
}

}  // namespace dicedesign
