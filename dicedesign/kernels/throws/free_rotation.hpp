// Rotation of a rigid body without torque, step by step.
#pragma once

#include <cmath>

#include "vector.hpp"

namespace dicedesign {

inline double twice_spin_energy(const Vec& moments, const Vec& spin) {
    return moments.x * spin.x * spin.x + moments.y * spin.y * spin.y + moments.z * spin.z * spin.z;
}

// The torque of Euler's equations, of a body with principal `moments`. Whole steps along what it
// does to the spin at their beginning, as MuJoCo takes them, add to the energy of the spin at a rate
// that goes with the step and that energy: little in a short flight, all bounds in a long one.
inline Vec gyroscopic_torque(const Vec& moments, const Vec& spin) {
    return {(moments.y - moments.z) * spin.y * spin.z, (moments.z - moments.x) * spin.z * spin.x,
            (moments.x - moments.y) * spin.x * spin.y};
}

// Turn a body, with orientation `q` and `spin` about its axes, by one step. The rotation is split
// into ones about the principal axes, each about as far as its part of the angular momentum says
// (Dullweber, Leimkuhler and McLachlan, Journal of Chemical Physics 107, 1997). It is symplectic
// and of second order: the angular momentum in the world is kept but for rounding, and the energy
// swings about what it was, by a part that goes with the square of the angle turned in a step.
inline void rotate_freely(double* q, Vec& spin, const Vec& moments, double step) {
    double momentum[3] = {moments.x * spin.x, moments.y * spin.y, moments.z * spin.z};
    const double moment[3] = {moments.x, moments.y, moments.z};
    const auto about = [&](int i, double seconds) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        // By the angle whose half has the tangent t, which needs no sine.
        const double t = 0.5 * seconds * momentum[i] / moment[i];
        const double part = 2.0 / (1.0 + t * t);
        const double cosine = part - 1.0, sine = t * part;
        const double mj = momentum[j], mk = momentum[k];
        momentum[j] = cosine * mj + sine * mk;
        momentum[k] = cosine * mk - sine * mj;
        const double w = q[0], qi = q[1 + i], qj = q[1 + j], qk = q[1 + k];
        q[0] = w - t * qi;
        q[1 + i] = qi + t * w;
        q[1 + j] = qj + t * qk;
        q[1 + k] = qk - t * qj;
    };
    about(0, 0.5 * step);
    about(1, 0.5 * step);
    about(2, step);
    about(1, 0.5 * step);
    about(0, 0.5 * step);
    spin = {momentum[0] / moments.x, momentum[1] / moments.y, momentum[2] / moments.z};
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; ++i) q[i] /= length;
}

}  // namespace dicedesign
