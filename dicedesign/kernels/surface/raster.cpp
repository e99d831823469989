#include "surface/raster.hpp"

#include <limits>
#include <utility>

namespace dicedesign {
namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();

struct End {
    double column, depth;
};

// The first of the pixels in a row or column, from 0 to below size, whose center is not before a
// place.
Index pixel_from(double place, Index size) {
    const double first = std::ceil(place - 0.5);
    if (!(first > 0.0)) return 0;
    return first < static_cast<double>(size) ? static_cast<Index>(first) : size;
}

// Where the center line of a row cuts a triangle.
void cut(const Vec* const corner[3], double center, End& left, End& right) {
    left = {INFINITE, INFINITE};
    right = {-INFINITE, -INFINITE};
    for (int k = 0; k < 3; ++k) {
        // Both triangles at an edge compute the same cuts if both start at its upper end.
        const Vec *a = corner[k], *b = corner[(k + 1) % 3];
        if (a->y > b->y) std::swap(a, b);
        if (!(a->y <= center && b->y > center)) continue;
        const double fraction = (center - a->y) / (b->y - a->y);
        const End end{a->x + fraction * (b->x - a->x), a->z + fraction * (b->z - a->z)};
        if (end.column < left.column) left = end;
        if (end.column > right.column) right = end;
    }
}

}  // namespace

void rasterize(const Vec* positions, const Index* triangles, Index count, Index size,
               std::vector<Index>& seen, std::vector<double>& depth) {
    seen.assign(size * size, -1);
    depth.assign(size * size, -INFINITE);
    for (Index t = 0; t < count; ++t) {
        const Vec* const corner[3] = {positions + triangles[3 * t],
                                      positions + triangles[3 * t + 1],
                                      positions + triangles[3 * t + 2]};
        const double top = smaller(smaller(corner[0]->y, corner[1]->y), corner[2]->y);
        const double bottom = larger(larger(corner[0]->y, corner[1]->y), corner[2]->y);
        for (Index row = pixel_from(top, size); row < pixel_from(bottom, size); ++row) {
            End left, right;
            cut(corner, static_cast<double>(row) + 0.5, left, right);
            const Index last = pixel_from(right.column, size);
            const double slope = (right.depth - left.depth) / (right.column - left.column);
            for (Index column = pixel_from(left.column, size); column < last; ++column) {
                const double here =
                    (static_cast<double>(column) + 0.5 - left.column) * slope + left.depth;
                const Index pixel = row * size + column;
                if (here >= depth[pixel]) {
                    depth[pixel] = here;
                    seen[pixel] = t;
                }
            }
        }
    }
}

}  // namespace dicedesign
