// The convex hull of points, made where rounding cannot change it.
#pragma once

#include <optional>
#include <vector>

#include "hull/half_edges.hpp"
#include "hull/hull.hpp"
#include "hull/measures.hpp"

namespace dicedesign {

// A hull with its half-edges, vertices and properties.
struct MadeHull {
    HalfEdges edges;
    std::vector<Vec> vertices;
    Connectivity connectivity;
    Measures measures;

    // Both point into this.
    Polyhedron polyhedron() const;
    Hull hull() const;
};

// The hull of points, see `convex_hull` in dicedesign/geometry/hulls/hull.py; nothing where that is
// uncertain. It has no normals where a facet is a sliver.
std::optional<MadeHull> make_hull(const Vec* points, std::size_t count, double coplanar_tolerance,
                                  double precision, const MeasureTolerances& tolerances);

}  // namespace dicedesign
