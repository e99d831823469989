// Flow lines of the support function, one at a time: `dicedesign.rest.tracing` for lines that
// rounding cannot change.
#pragma once

#include <vector>

#include "rest/elements.hpp"

namespace dicedesign {

// Follows the flow line uphill from a saddle's half-edge into the cell of one of its ends; appends
// the half-edges whose arcs it crosses, and says at which maximum it ends.
Verdict ascend(const Frame<double>& frame, const Elements& elements, Index saddle, Index vertex,
               std::vector<Index>& crossed, Index& maximum);

// Facet that a body tips onto which slides downhill from a facet over a vertex to a hinge edge.
Verdict descend(const Frame<double>& frame, const Elements& elements, Index facet, Index& reached);

// Facet that a body tips onto which slides downhill from a direction of length 1 in the cell of a
// vertex, wrong by no more than the error; false where rounding could change it.
bool slide(const Frame<double>& frame, const Elements& elements, Index vertex,
           const Vec& direction, double error, Index& reached);

}  // namespace dicedesign
