// Impact of a rigid body with the table at one point.
#pragma once

#include "vector.hpp"

namespace dicedesign {

// Change of a point's velocity per impulse at that point, 1/mass: a symmetric positive definite
// matrix, with z along the table's normal.
struct Response {
    double xx, xy, yy, xz, yz, zz;

    Vec operator*(const Vec& impulse) const {
        return {xx * impulse.x + xy * impulse.y + xz * impulse.z,
                xy * impulse.x + yy * impulse.y + yz * impulse.z,
                xz * impulse.x + yz * impulse.y + zz * impulse.z};
    }

    // Impulse that changes the velocity by `change`.
    Vec solve(const Vec& change) const {
        const Vec a{xx, xy, xz}, b{xy, yy, yz}, c{xz, yz, zz};
        const Vec bc = cross(b, c);
        const double over = 1.0 / dot(a, bc);
        return {over * dot(change, bc), over * dot(change, cross(c, a)),
                over * dot(change, cross(a, b))};
    }
};

struct Surface {
    double restitution;  // energetic: root of the ratio of the normal force's works, in [0, 1]
    double friction;     // Coulomb's
};

// Impulse on a point that moves with `velocity` and approaches the table.
//
// The normal impulse grows from 0 while the point slides or sticks under Coulomb friction, whose
// direction follows the slip (Keller, Journal of Applied Mechanics 53, 1986). The impact ends when
// the normal force has returned the squared restitution times the work that compression took
// (Stronge, Proceedings of the Royal Society A 431, 1990). Friction and the normal force take
// energy in each segment of the integration, so that no impulse adds energy, whatever its accuracy.
Vec impact(const Response& response, const Vec& velocity, const Surface& surface);

// Impulse without restitution that slows the normal velocity of an approaching point to `target`,
// at most 0: one of the many small ones of a point that stays on the table. It stops the slip if
// friction is enough for that, and is otherwise part of an `impact`.
Vec stop(const Response& response, const Vec& velocity, double friction, double target);

}  // namespace dicedesign
