// Where a body will come to rest once it can leave the basin it is in no more.
#pragma once

#include "vector.hpp"

namespace dicedesign {

// A hull about its center of mass, with its basins. The neighbors of vertex v are entries
// `start[v]` to `start[v + 1]` of the three lists.
struct Landscape {
    Index vertices;
    const Vec* vertex;      // from the center of mass
    const Index* start;
    const Index* neighbor;
    const Index* left;      // facet left of the edge to the neighbor
    const Index* right;
    const Vec* normal;      // of each facet
    const Index* rest;      // to which each facet rolls
    const double* barrier;  // for each rest the height of the lowest saddle on its basin's border
    const double* flat;     // for each rest the height at rest, the least distance of an edge from
                            // the foot, and what turns a spinning body over, see `slides_to_rest`
    double highest_barrier;
};

// The rest in whose basin a direction `down` (not zero) lies, by the momentum-free path; -1 if
// rounding hides the path.
Index rest_below(const Landscape& land, Vec down);

// Returned while no rest is certain.
inline constexpr Index STILL_MOVING = -1;

}  // namespace dicedesign
