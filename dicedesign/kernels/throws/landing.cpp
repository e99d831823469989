#include "throws/landing.hpp"

#include <limits>

namespace dicedesign {
namespace {

Index lowest_vertex(const Landscape& land, const Vec& down) {
    Index lowest = 0;
    double deepest = -std::numeric_limits<double>::infinity();
    for (Index v = 0; v < land.vertices; ++v) {
        const double depth = dot(land.vertex[v], down);
        if (depth > deepest) {
            deepest = depth;
            lowest = v;
        }
    }
    return lowest;
}

}  // namespace

Index rest_below(const Landscape& land, Vec down) {
    Index p = lowest_vertex(land, down);
    // Heights fall along the path, so no cell is entered twice.
    for (Index cells = 0; cells < land.vertices; ++cells) {
        const Vec& r = land.vertex[p];
        // On p the body turns away from r: down - t r, until another vertex is as low.
        double soonest = std::numeric_limits<double>::infinity();
        Index exit = -1;
        for (Index e = land.start[p]; e < land.start[p + 1]; ++e) {
            const Vec v = r - land.vertex[land.neighbor[e]];
            const double approach = dot(v, r);
            if (approach <= 0.0) continue;
            const double t = dot(v, down) / approach;
            if (t < soonest) {
                soonest = t;
                exit = e;
            }
        }
        if (exit < 0) return -1;
        down = down - larger(soonest, 0.0) * r;
        const double length = norm(down);
        if (!(length > 0.0)) return -1;
        down = (1.0 / length) * down;
        const Vec& q = land.vertex[land.neighbor[exit]];
        const Vec v = r - q;
        if (dot(v, q) >= 0.0) {
            p = land.neighbor[exit];
            continue;
        }
        // On a hinge it turns away from the saddle direction, to the facet on that side.
        const Vec foot = r - (dot(r, v) / dot(v, v)) * v;
        const Vec across = land.normal[land.left[exit]] - land.normal[land.right[exit]];
        const Vec away = dot(foot, down) * down - foot;
        return land.rest[dot(away, across) > 0.0 ? land.left[exit] : land.right[exit]];
    }
    return -1;
}

}  // namespace dicedesign
