// Pictures by a depth buffer: `rasterize` in dicedesign/report/raster.py.
#pragma once

#include <vector>

#include "vector.hpp"

namespace dicedesign {

// Nearest of `count` triangles in each of size x size pixels, or -1, and its depth, or -inf.
// Positions are column, row and depth in pixels; of equal depths the later triangle counts.
void rasterize(const Vec* positions, const Index* triangles, Index count, Index size,
               std::vector<Index>& seen, std::vector<double>& depth);

}  // namespace dicedesign
