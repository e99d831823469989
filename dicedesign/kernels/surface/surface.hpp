// Which triangles of a surface meet at edges: `is_closed` in dicedesign/geometry/triangles.py and the
// shells of dicedesign/geometry/meshes/body.py.
#pragma once

#include <vector>

#include "vector.hpp"

namespace dicedesign {

// Whether every edge of `count` triangles is passed equally often in both directions; indices are
// below `points`.
bool is_closed(const Index* triangles, Index count, Index points);

// Number of the shell of each triangle, from 0 in the order of their first triangles; triangles of
// one shell are joined by edges.
std::vector<Index> shells(const Index* triangles, Index count, Index points);

}  // namespace dicedesign
