// Throws of a rigid body onto the plane z = 0.
#pragma once

#include "throws/landing.hpp"
#include "throws/motion.hpp"
#include "throws/soft_contact.hpp"

namespace dicedesign {

struct Throw {
    ContactModel contact;
    double step;     // seconds
    double gravity;  // m/s^2
    double drag;     // 1/s, of the spin of a body with the mean moment of inertia
};

// Advance a body of mass 1 by at most `steps` steps, or until it is too slow to leave the basin
// that it is in: its energy is then below all saddles of the basin's border. One whose motion
// is no longer finite is given up. `taken` is how many steps it took.
Index advance(const Landscape& land, const Vec& moments, const Throw& how, Index steps,
              Motion& motion, Index& taken);

}  // namespace dicedesign
