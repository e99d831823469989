#include "hull/simplex.hpp"

#include <utility>

#include "hull/orientation.hpp"

namespace dicedesign {
namespace {

// The point at which a measure is largest.
template <class Measure>
int farthest(const std::vector<Vec>& points, Measure measure) {
    int found = 0;
    double largest = -1.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double value = measure(points[i]);
        if (value <= largest) continue;
        largest = value;
        found = static_cast<int>(i);
    }
    return found;
}

// The first of the points with the smallest and the largest of each coordinate.
std::array<int, 6> extremes(const std::vector<Vec>& points) {
    std::array<int, 6> found{};
    for (std::size_t i = 1; i < points.size(); ++i) {
        const Vec& p = points[i];
        const int number = static_cast<int>(i);
        if (p.x < points[found[0]].x) found[0] = number;
        if (p.x > points[found[1]].x) found[1] = number;
        if (p.y < points[found[2]].y) found[2] = number;
        if (p.y > points[found[3]].y) found[3] = number;
        if (p.z < points[found[4]].z) found[4] = number;
        if (p.z > points[found[5]].z) found[5] = number;
    }
    return found;
}

double squared(const Vec& a) { return dot(a, a); }

}  // namespace

std::optional<Simplex> wide_simplex(const std::vector<Vec>& points) {
    const std::array<int, 6> extreme = extremes(points);
    Simplex corner{extreme[0], extreme[1], 0, 0};
    for (const int i : extreme) {
        for (const int j : extreme) {
            if (squared(points[i] - points[j]) <=
                squared(points[corner[0]] - points[corner[1]]))
                continue;
            corner[0] = i;
            corner[1] = j;
        }
    }
    const Vec first = points[corner[0]], along = points[corner[1]] - first;
    corner[2] =
        farthest(points, [&](const Vec& p) { return squared(cross(p - first, along)); });
    const Vec normal = cross(along, points[corner[2]] - first);
    corner[3] = farthest(points, [&](const Vec& p) { return std::fabs(dot(normal, p - first)); });
    const int side =
        exact_side(first, points[corner[1]], points[corner[2]], points[corner[3]]);
    if (side == 0) return std::nullopt;
    if (side > 0) std::swap(corner[0], corner[1]);
    return corner;
}

}  // namespace dicedesign
