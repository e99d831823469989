// From labeled triangles to facets as loops of half-edges.
#pragma once

#include <optional>
#include <vector>

#include "hull/coplanar.hpp"
#include "hull/triangulation.hpp"
#include "vector.hpp"

namespace dicedesign {

// As in `ConvexHull` of dicedesign/geometry/hulls/hull.py.
struct HalfEdges {
    std::vector<Index> source, facet_start, tail, twin;
    std::vector<Index> facet_of_label;
};

// Corners at which only two facets meet are left out. `number` is what `source` calls the points,
// each number up to theirs once. Nothing where the facets make no polyhedron.
std::optional<HalfEdges> facet_loops(const std::vector<int>& number, const Triangles& triangles,
                                     const FacetLabels& facets);

}  // namespace dicedesign
