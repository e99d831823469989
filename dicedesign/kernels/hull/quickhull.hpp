// The convex hull of points as triangles.
#pragma once

#include <optional>
#include <vector>

#include "hull/triangulation.hpp"
#include "vector.hpp"

namespace dicedesign {

// The hull of points with coordinates up to 1: no point lies above a triangle and no triangle is
// degenerate, but neighbors may lie in one plane. Points may come in any order;
// `number` is what counts as theirs. The first of points at one place stands for all. Nothing where
// all points are on one plane, or where one that is left out is as near as `near` to a corner of
// higher number, measured along the axes.
std::optional<Triangles> quickhull(const std::vector<Vec>& points, const std::vector<int>& number,
                                   double near);

}  // namespace dicedesign
