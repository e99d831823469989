// Free flight of a rigid body, until it can touch the table.
#pragma once

#include <cmath>

#include "throws/landing.hpp"
#include "throws/motion.hpp"

namespace dicedesign {

// Longest time that a vertex at height `z` is above the table, if it moves up with `speed` and is
// accelerated down by at most `bent`.
inline double time_above(double z, double speed, double bent) {
    return (speed + std::sqrt(speed * speed + 2.0 * bent * larger(z, 0.0))) / bent;
}

// Bounds of the motion of a body's vertices in flight. Each moves on with its speed, bent by
// gravity and by the turning: a spin of at most w, by the energy, gives it an acceleration of at
// most w^2 r, and changes, by Euler's equations, by at most w^2, besides a brake's torque per spin.
struct FlightBounds {
    FlightBounds(const Vec& moments, double gravity, const Vec& spin, double reach,
                 double brake) {
        const double least = smaller(moments.x, smaller(moments.y, moments.z));
        fastest = twice_spin_energy(moments, spin) / least;
        bent = gravity + 2.0 * fastest * reach;
        // A flight takes all of its drag at the start, which moves a vertex twice as far.
        if (brake > 0.0) bent += 2.0 * brake / least * std::sqrt(fastest) * reach;
    }

    double fastest;  // squared spin, rad^2/s^2
    double bent;     // downward acceleration of a vertex, m/s^2
};

// Time, at most `most`, during which no vertex of a body gets below the table, but for those that
// `leave_out`, a function of a vertex's height and speed, is true for.
template <class LeaveOut>
double time_of_flight(const Landscape& land, const FlightBounds& bounds, double gravity,
                      const Motion& motion, const Vec& up, double reach, double most,
                      const LeaveOut& leave_out) {
    const double height = motion.position.z, rising = motion.velocity.z;
    // Whatever its turn is, above its reach it cannot touch.
    const double above = height - reach;
    const double high = above > 0.0 ? time_above(above, rising, gravity) : 0.0;
    double safe = most;
    const Vec across = cross(up, motion.spin);
    for (Index v = 0; v < land.vertices && safe > high; ++v) {
        const double z = height + dot(up, land.vertex[v]);
        const double speed = rising + dot(across, land.vertex[v]);
        if (z + safe * (speed - 0.5 * bounds.bent * safe) > 0.0 || leave_out(z, speed)) continue;
        safe = time_above(z, speed, bounds.bent);
    }
    return smaller(larger(safe, high), most);
}

}  // namespace dicedesign
