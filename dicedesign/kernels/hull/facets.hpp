// Facets of a hull as functions of its vertices, and their adjoint.
#pragma once

#include <vector>

#include "hull/hull.hpp"

namespace dicedesign {

// The outward normal of a facet, twice its area long.
Vec area_vector(const Polyhedron& hull, Index facet);

// Add the gradient in the area vector of a facet to that in the vertices.
void pull_back_area_vector(const Polyhedron& hull, Index facet, const Vec& gradient,
                           Vec* by_vertices);

// A unit vector and the length it was scaled from.
struct Direction {
    Vec unit;
    double length;

    explicit Direction(const Vec& vector)
        : unit((1.0 / norm(vector)) * vector), length(norm(vector)) {}

    // Gradient in the vector for that in the unit vector.
    Vec pull_back(const Vec& gradient) const {
        return before_scaling(gradient, unit, length);
    }
};

// Add the gradients in half-spaces for those (t) in corners, each where three of their planes meet.
// A half-space is n . x <= exp(l): `normals` (m) of some length, with l (m) in `logarithms`, have
// the polar points `polar` (m), and corner t is on the planes `planes[3 t : 3 t + 3]`.
void pull_back_corners(const Vec* normals, const Vec* polar, const Index* planes,
                       const Vec* corners, Index corner_count, Index plane_count,
                       const Vec* gradients, Vec* by_normals, double* by_logarithms);

// Depths (m) of the facets: how far inside of each the foot of the center lies, from the line of
// the nearest edge, over the circumscribed radius; positive for rests.
std::vector<double> facet_depths(const Polyhedron& hull, const Vec& center);

// Add the gradient of the weighted sum (m) of depths to the gradients in the vertices and the center.
// Equally near edges, and equally far vertices, share it equally.
void pull_back_depths(const Polyhedron& hull, const Vec& center, const double* weights,
                      Vec* by_vertices, Vec& by_center);

}  // namespace dicedesign
