// Rotation of a rigid body without torque.
#pragma once

#include <algorithm>
#include <cmath>

#include "vector.hpp"

namespace dicedesign {

// Terms of the series at most, and the angle in radians within which they are used: the spin has no
// pole nearer than half a turn or so, as no term of Euler's equations has a factor above 1.
inline constexpr int SERIES_TERMS = 20;
inline constexpr double SERIES_ANGLE = 0.7;

// Terms smaller than this, relative to what they belong to, end the series.
inline constexpr double SERIES_TOLERANCE = 1e-15;

// Turn a body, with orientation `q` and `spin` about its principal axes, for some time, by the power
// series of Euler's equations and of the orientation: each coefficient is a sum of products of those
// before it. Right to rounding, however long.
inline void rotate_freely(double* q, Vec& spin, const Vec& moments, double seconds) {
    // Of a term's two factors: the rates at which spins change with products of the others.
    const double rates[3] = {(moments.y - moments.z) / moments.x,
                             (moments.z - moments.x) / moments.y,
                             (moments.x - moments.y) / moments.z};
    double w[SERIES_TERMS][3] = {{spin.x, spin.y, spin.z}}, p[SERIES_TERMS][4];
    while (seconds > 0.0) {
        const double size =
            std::sqrt(w[0][0] * w[0][0] + w[0][1] * w[0][1] + w[0][2] * w[0][2]);
        // Coefficients are of powers of time over `part`, so that they are terms themselves.
        const double part = size * seconds > SERIES_ANGLE ? SERIES_ANGLE / size : seconds;
        std::copy(q, q + 4, p[0]);
        double spun[3] = {w[0][0], w[0][1], w[0][2]}, turned[4] = {q[0], q[1], q[2], q[3]};
        for (int k = 1; k < SERIES_TERMS; ++k) {
            double x = 0.0, y = 0.0, z = 0.0, a = 0.0, b = 0.0, c = 0.0, d = 0.0;
            for (int i = 0; i < k; ++i) {
                const double* const u = w[i];
                const double* const v = w[k - 1 - i];
                const double* const o = p[i];
                x += u[1] * v[2];
                y += u[2] * v[0];
                z += u[0] * v[1];
                a -= o[1] * v[0] + o[2] * v[1] + o[3] * v[2];
                b += o[0] * v[0] + o[2] * v[2] - o[3] * v[1];
                c += o[0] * v[1] + o[3] * v[0] - o[1] * v[2];
                d += o[0] * v[2] + o[1] * v[1] - o[2] * v[0];
            }
            const double over = part / k;
            const double turn[4] = {0.5 * over * a, 0.5 * over * b, 0.5 * over * c, 0.5 * over * d};
            const double spins[3] = {over * rates[0] * x, over * rates[1] * y, over * rates[2] * z};
            std::copy(turn, turn + 4, p[k]);
            std::copy(spins, spins + 3, w[k]);
            double most = 0.0, most_spin = 0.0;
            for (int i = 0; i < 4; ++i) {
                turned[i] += turn[i];
                most = larger(most, std::abs(turn[i]));
            }
            for (int i = 0; i < 3; ++i) {
                spun[i] += spins[i];
                most_spin = larger(most_spin, std::abs(spins[i]));
            }
            if (most <= SERIES_TOLERANCE && most_spin <= SERIES_TOLERANCE * size) break;
        }
        const double length = std::sqrt(turned[0] * turned[0] + turned[1] * turned[1] +
                                        turned[2] * turned[2] + turned[3] * turned[3]);
        for (int i = 0; i < 4; ++i) q[i] = turned[i] / length;
        std::copy(spun, spun + 3, w[0]);
        seconds -= part;
    }
    spin = {w[0][0], w[0][1], w[0][2]};
}

}  // namespace dicedesign
