// Whether moved points certainly have the hull they had.
#pragma once

#include <vector>

#include "hull/measures.hpp"

namespace dicedesign {

// Tolerances of dicedesign/tolerances.py.
struct ReuseTolerances {
    double flatness, margin, leverage, turn, offset;
};

// Whether facets certainly bound a convex body that contains other points, and no coplanar
// tolerance changes them; see dicedesign/geometry/hulls/hull.py. False too where a number is
// missing or infinite.
bool is_convex(const Polyhedron& hull, const Measures& measures, const std::vector<Vec>& others,
               const ReuseTolerances& tolerances);

}  // namespace dicedesign
