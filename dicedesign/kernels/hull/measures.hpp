// Normals, areas and centroid of a convex polyhedron with polygonal facets.
#pragma once

#include <vector>

#include "hull/hull.hpp"

namespace dicedesign {

struct Connectivity {
    explicit Connectivity(const Polyhedron& hull);

    std::vector<Index> facet, next, previous, head, outgoing_start, outgoing;
};

// Tolerances of dicedesign/tolerances.py.
struct MeasureTolerances {
    double sliver, thin_volume, rounding;
};

// The properties of `ConvexHull` with these names, all computed here.
struct Measures {
    Measures(const Polyhedron& hull, const MeasureTolerances& tolerances);

    bool has_normals = false;  // none has where a facet is too thin a sliver
    std::vector<Vec> normals;
    std::vector<double> areas;
    double unevenness = 0.0;
    bool is_flat = false;       // facets are uneven by no more than rounding
    bool has_centroid = false;  // none has where the body is thin
    Vec centroid{0.0, 0.0, 0.0};

private:
    bool measure_facet(const Polyhedron& hull, const std::vector<Vec>& points, Index facet,
                       double sliver);
};

}  // namespace dicedesign
