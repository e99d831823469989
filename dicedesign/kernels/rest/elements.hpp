// What each facet, edge and vertex of a hull does: `dicedesign.rest.equilibria` for decisions that
// rounding cannot change.
#pragma once

#include <vector>

#include "rest/frame.hpp"

namespace dicedesign {

// How sure an answer is.
enum class Verdict {
    certain,
    tied,      // a move of the center of mass within the tie distance may change it
    uncertain  // rounding may change it
};

// Decisions about a hull, under the names of `Equilibria`; truth values are 0 or 1.
struct Elements {
    std::vector<Index> growth_sign, side_sign;  // of half-edges
    std::vector<char> ascending, descending, hinge;
    std::vector<char> maximum;  // of vertices
    std::vector<char> stable;   // of facets
    std::vector<Index> roll_edge;

    // Whether a half-edge carries a saddle.
    bool saddle(const Hull& hull, Index e) const {
        return hinge[e] && side_sign[e] > 0 && side_sign[hull.twin[e]] > 0;
    }
};

// Decides about all elements, or says why not.
Verdict classify(const Frame<double>& frame, Elements& elements);

// Vertex that the body on a facet tips onto which rolls over none of its edges.
Index roll_vertex(const Frame<double>& frame, const Elements& elements, Index facet);

}  // namespace dicedesign
