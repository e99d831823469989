// Throws of a rigid body onto the plane z = 0, which it meets in impacts of single vertices.
#pragma once

#include "throws/impact.hpp"
#include "throws/landing.hpp"
#include "throws/motion.hpp"

namespace dicedesign {

struct Throw {
    Surface surface;
    double step;     // seconds: of a body that stays on the table
    double gravity;  // m/s^2
    double drag;     // 1/s, of the spin of a body with the mean moment of inertia
};

// Advance a body of mass 1 for `steps` steps, or until it is too slow to leave the basin that it is
// in: its energy is then below all saddles of the basin's border, or it slides and spins to a stop
// without tipping. One whose motion is no longer finite is given up. `taken` is how many steps it
// moved, the last one perhaps in part.
//
// Without drag flight is exact. Impacts are those of `impact.hpp`, of one vertex after the other,
// the fastest first. Vertices that approach slowly are stopped at the table, without restitution,
// once a step. Energy never grows.
Index advance(const Landscape& land, const Vec& moments, const Throw& how, Index steps,
              Motion& motion, Index& taken);

}  // namespace dicedesign
