// A convex hull as half-edges.
#pragma once

#include "vector.hpp"

namespace dicedesign {

// Fields of `ConvexHull` in dicedesign/geometry/hulls/hull.py, under their names.
struct Polyhedron {
    const Vec* vertices;  // (n)
    Index vertex_count;
    const Index* facet_start;  // (m + 1)
    Index facet_count;
    const Index* tail;  // (h)
    const Index* twin;  // (h)

    Index half_edge_count() const { return facet_start[facet_count]; }
};

// The same with the properties of a `ConvexHull` that kernels use.
struct Hull : Polyhedron {
    const Index *head, *facet, *next, *previous;
    const Index *outgoing_start, *outgoing;
    const Vec* normals;
    const double* areas;
};

}  // namespace dicedesign
