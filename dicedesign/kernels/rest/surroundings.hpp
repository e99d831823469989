// A center of mass within its hull: how near the boundary is, and how large everything is.
#pragma once

#include "hull/hull.hpp"

namespace dicedesign {

// The number and the height of the lowest facet above a point, the largest difference of a
// coordinate from the vertices' mean, the largest coordinate of vertices and point, and the largest
// extent; see dicedesign/rest/equilibria.py.
struct Surroundings {
    Index facet;
    double height, offset, far, extent;
};

Surroundings surroundings(const Hull& hull, const Vec& point);

}  // namespace dicedesign
