// Which separatrices divide which basins: `dicedesign.rest.morse.separatrices` for bodies about
// which rounding can change nothing.
#pragma once

#include <vector>

#include "rest/elements.hpp"

namespace dicedesign {

// The arrays of a `dicedesign.rest.morse.Separatrices`, under its names.
struct Separatrices {
    std::vector<Index> rests, saddles, basins, saddle_ends, crossings, branch_start, maxima;
};

// Stable facets on which bodies come to rest that are let go on `count` facets.
Verdict find_destinations(const Hull& hull, const Vec& center, const Tolerances& tolerances,
                          const Index* facets, Index count, std::vector<Index>& reached);

Verdict find_separatrices(const Hull& hull, const Vec& center, const Tolerances& tolerances,
                          Elements& elements, Separatrices& found);

}  // namespace dicedesign
