// Areas of the basins of attraction from the separatrices that divide them.
#pragma once

#include <vector>

#include "hull/hull.hpp"

namespace dicedesign {

// The separatrices as `Separatrices` in dicedesign/rest/morse.py holds them.
struct Paths {
    Index rests;                // k
    Index saddles;              // s
    const Index* resting;       // (k) stable facets
    const Index* basins;        // (s, 2)
    const Index* saddle_ends;   // (s, 2)
    const Index* crossings;     // (c, 2)
    const Index* branch_start;  // (2 s + 1)
    const Index* maxima;        // (2 s)
};

// Unit vectors along a branch: the saddle, the crossings, the maximum.
void branch_points(const Paths& paths, Index branch, const Vec* vertices, const Vec& center,
                   std::vector<Vec>& points);

// Areas (k) up to multiples of 4 pi, measured from the rests' normals (k) where these see the
// border well, from another direction elsewhere: where it comes nearer to their antipodes, as
// 1 + cosine, than `near_antipode`.
std::vector<double> signed_areas(const Hull& hull, const Paths& paths, const Vec& center,
                                 double near_antipode);

// Add the missing multiples of 4 pi to signed areas; false where the basins then do not cover the
// sphere once to within a tolerance in steradian.
bool close_areas(std::vector<double>& areas, double tolerance);

}  // namespace dicedesign
