// Points at exactly equal positions.
#pragma once

#include <vector>

#include "vector.hpp"

namespace dicedesign {

// The first point at each position, in order, and of each point the place of its position there.
struct Positions {
    std::vector<Index> first, group;
};

// Of finite points; -0 equals 0.
Positions distinct_positions(const Vec* points, std::size_t count);

}  // namespace dicedesign
