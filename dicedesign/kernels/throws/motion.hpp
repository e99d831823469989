// Motion of a rigid body of mass 1 above the plane z = 0.
#pragma once

#include "vector.hpp"

namespace dicedesign {

// Position (m), orientation as a quaternion from the body's principal axes to the world's, velocity
// (m/s) and angular velocity about the body's axes (rad/s).
struct Motion {
    Vec position;
    double turn[4];
    Vec velocity;
    Vec spin;
};

// Rows of the matrix that turns the body's axes into the world's.
struct Axes {
    explicit Axes(const double* q) {
        const double w = q[0], x = q[1], y = q[2], z = q[3];
        row[0] = {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)};
        row[1] = {2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)};
        row[2] = {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)};
    }

    Vec row[3];
};

inline double twice_spin_energy(const Vec& moments, const Vec& spin) {
    return moments.x * spin.x * spin.x + moments.y * spin.y * spin.y + moments.z * spin.z * spin.z;
}

inline double twice_kinetic_energy(const Vec& moments, const Motion& motion) {
    return dot(motion.velocity, motion.velocity) + twice_spin_energy(moments, motion.spin);
}

}  // namespace dicedesign
