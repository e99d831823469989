// Points in an order in which those near each other in space are near each other in memory.
#pragma once

#include <vector>

#include "vector.hpp"

namespace dicedesign {

// The numbers of points in [-1, 1] along a space-filling curve; of points at one place the first
// comes first.
std::vector<int> spatial_order(const std::vector<Vec>& points);

}  // namespace dicedesign
