// Which triangles of a hull form one flat facet.
#pragma once

#include <vector>

#include "hull/triangulation.hpp"
#include "vector.hpp"

namespace dicedesign {

// The facet of each triangle, numbered from 0, and how many there are: all corners of a facet lie
// within `tolerance` of the plane of its largest triangle. See
// dicedesign/geometry/hulls/numpy_hull.py.
struct FacetLabels {
    std::vector<int> label;
    int facets;
};

FacetLabels facet_labels(const std::vector<Vec>& points, const Triangles& triangles,
                         double tolerance);

// The same for facets that are exactly flat.
FacetLabels flat_labels(const std::vector<Vec>& points, const Triangles& triangles);

}  // namespace dicedesign
