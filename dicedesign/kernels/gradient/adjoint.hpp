// Derivatives of the basins' areas and of the centroid by reverse sweeps.
#pragma once

#include "rest/areas.hpp"
#include "hull/facets.hpp"

namespace dicedesign {

// Add the gradient of the weighted sum (k) of areas to that in the vertices (n) and in the center.
void pull_back_areas(const Paths& paths, const Vec* vertices, const Vec& center,
                     const double* weights, Vec* by_vertices, Vec& by_center);

// Add the gradient of each area to row k of those in the vertices (k, n) and in the center (k).
void area_jacobian(const Paths& paths, const Vec* vertices, Index count, const Vec& center,
                   Vec* by_vertices, Vec* by_center);

// Add the gradient of `gradient . centroid`, of the uniform solid hull, to that in the vertices; false where its volume is below a part of the cube of the largest coordinate of a
// vertex from the mean of all.
bool pull_back_centroid(const Polyhedron& hull, const Vec& gradient, double thin_volume,
                        Vec* by_vertices);

}  // namespace dicedesign
