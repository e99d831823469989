// A tetrahedron to begin a hull with.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "vector.hpp"

namespace dicedesign {

// Numbers of its corners: the last lies below the triangle of the others, which turns
// counter-clockwise seen from above.
using Simplex = std::array<int, 4>;

// Corners among points that are far from each other; nothing where they are on one plane.
std::optional<Simplex> wide_simplex(const std::vector<Vec>& points);

}  // namespace dicedesign
