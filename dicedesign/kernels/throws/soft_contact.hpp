// Forces between a rigid body and the table it touches at a few points.
#pragma once

#include "vector.hpp"

namespace dicedesign {

// What a contact is like, for a body of mass 1.
struct ContactModel {
    double stiffness;          // 1/s^2: acceleration of a contact point per depth
    double damping;            // 1/s, along the normal
    double sliding_damping;    // 1/s, along the table
    double friction;           // Coulomb's
    double impedance;          // in (0, 1): how much of the wanted acceleration is had
};

inline constexpr int COORDINATES = 6;  // acceleration along x, y, z and about the body's axes
inline constexpr int MOST_CONTACTS = 8;

using Acceleration = double[COORDINATES];

// One point of contact. Its three rows are the normal (z) and the table's x and y.
struct Contact {
    double rows[3][COORDINATES];  // Jacobian of the point's velocity
    double wanted[3];             // acceleration of the point
    double missed[3];             // acceleration beyond that
    double force[3];
    double curvature[3][3];  // second derivatives of the contact's cost
    bool active;
};

// The acceleration that minimizes Gauss' measure of constraint plus the contacts' costs: MuJoCo's
// convex formulation of soft contact with elliptic friction cones (its documentation, chapter
// "Computation"), here by Newton's method with backtracking.
//
// masses: of each coordinate; free: acceleration without contacts; acceleration: first guess, then
// the answer; contacts: `count` of them with `rows` and `wanted` set.
void solve_contacts(const Acceleration masses, const Acceleration free, Acceleration acceleration,
                    Contact* contacts, int count, const ContactModel& model);

}  // namespace dicedesign
