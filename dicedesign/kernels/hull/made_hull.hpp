// The convex hull of points, made where rounding cannot change it.
#pragma once

#include <optional>
#include <vector>

#include "hull/half_edges.hpp"
#include "hull/hull.hpp"
#include "hull/measures.hpp"

namespace dicedesign {

// Half-edges between the vertices of a hull, and its measures.
struct MeasuredHull {
    MeasuredHull(const Vec* points, HalfEdges&& half_edges, const MeasureTolerances& tolerances);

    // Points into this.
    Polyhedron polyhedron() const;

    HalfEdges edges;
    std::vector<Vec> vertices;
    Measures measures;
};

// The same with all that kernels use.
struct MadeHull : MeasuredHull {
    MadeHull(const Vec* points, HalfEdges&& half_edges, const MeasureTolerances& tolerances);

    // Points into this.
    Hull hull() const;

    Connectivity connectivity;
};

// The hull of points with facets that are flat within a tolerance above 0, see `convex_hull` in
// dicedesign/geometry/hulls/hull.py; nothing where that is uncertain. It has no normals where a
// facet is a sliver.
std::optional<MadeHull> make_hull(const Vec* points, std::size_t count, double coplanar_tolerance,
                                  double precision, const MeasureTolerances& tolerances);

// The hull of points as they are: its facets are exactly flat.
struct ExactHull {
    MadeHull hull;
    std::optional<MeasuredHull> merged;  // its facets merged, if any are and make a polyhedron,
    std::vector<Index> merged_facet;     // and the one that each facet belongs to
};

// A tolerance of 0 merges nothing. Nothing where the points span no solid, or have digits so small
// that products lose them.
std::optional<ExactHull> make_exact_hull(const Vec* points, std::size_t count,
                                         double coplanar_tolerance, double precision,
                                         const MeasureTolerances& tolerances);

}  // namespace dicedesign
