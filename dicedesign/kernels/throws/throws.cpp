#include "throws/throws.hpp"

#include <algorithm>
#include <cmath>

#include "throws/free_rotation.hpp"
#include "throws/near_table.hpp"

namespace dicedesign {
namespace {

constexpr Index STEPS_PER_CHECK = 16;

// Rows of the matrix that turns the body's axes into the world's.
struct Axes {
    explicit Axes(const double* q) {
        const double w = q[0], x = q[1], y = q[2], z = q[3];
        row[0] = {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)};
        row[1] = {2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)};
        row[2] = {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)};
    }

    Vec to_body(const Vec& v) const { return v.x * row[0] + v.y * row[1] + v.z * row[2]; }

    Vec row[3];
};

// Vertices below the table and their heights; of more than fit, the lowest.
struct Touching {
    int count = 0;
    Index vertex[MOST_CONTACTS];
    double height[MOST_CONTACTS];

    void add(Index v, double z) {
        if (count < MOST_CONTACTS) {
            vertex[count] = v;
            height[count++] = z;
            return;
        }
        double* const highest = std::max_element(height, height + MOST_CONTACTS);
        if (z < *highest) {
            vertex[highest - height] = v;
            *highest = z;
        }
    }
};

void set_contact(Contact& c, const Axes& axes, const Vec& arm, double height, const Motion& motion,
                 const ContactModel& model) {
    // Halfway between the vertex and the table.
    const Vec point = arm - 0.5 * height * axes.row[2];
    const int order[3] = {2, 0, 1};
    const double velocity[3] = {motion.velocity.z, motion.velocity.x, motion.velocity.y};
    for (int r = 0; r < 3; ++r) {
        const Vec turning = cross(point, axes.row[order[r]]);
        std::fill(c.rows[r], c.rows[r] + 3, 0.0);
        c.rows[r][order[r]] = 1.0;
        c.rows[r][3] = turning.x;
        c.rows[r][4] = turning.y;
        c.rows[r][5] = turning.z;
        const double speed = velocity[r] + dot(turning, motion.spin);
        c.wanted[r] = r == 0
                          ? -(model.damping * speed + model.stiffness * height) / model.impedance
                          : -model.sliding_damping / model.impedance * speed;
    }
}

// Set the contacts of a body, and return how many there are.
int set_contacts(const Landscape& land, NearTable& near, const Motion& motion,
                 const ContactModel& model, Contact* contacts) {
    const Axes axes(motion.turn);
    const double height = motion.position.z;
    Touching found;
    for (const Index v : near.at(axes.row[2], height)) {
        const double z = height + dot(axes.row[2], land.vertex[v]);
        if (z < 0.0) found.add(v, z);
    }
    for (int k = 0; k < found.count; ++k) {
        set_contact(contacts[k], axes, land.vertex[found.vertex[k]], found.height[k], motion,
                    model);
    }
    return found.count;
}

void turn(double* q, const Vec& spin, double step) {
    const double rate = norm(spin), half = 0.5 * step * rate;
    const double s = rate > 0.0 ? std::sin(half) / rate : 0.5 * step;
    const double w = std::cos(half);
    const Vec v = s * spin;
    const double turned[4] = {q[0] * w - q[1] * v.x - q[2] * v.y - q[3] * v.z,
                              q[0] * v.x + q[1] * w + q[2] * v.z - q[3] * v.y,
                              q[0] * v.y - q[1] * v.z + q[2] * w + q[3] * v.x,
                              q[0] * v.z + q[1] * v.y - q[2] * v.x + q[3] * w};
    const double length = std::sqrt(turned[0] * turned[0] + turned[1] * turned[1] +
                                    turned[2] * turned[2] + turned[3] * turned[3]);
    for (int i = 0; i < 4; ++i) q[i] = turned[i] / length;
}

// Height to which all energy would lift the center of mass. What is stored in contacts counts as if
// all of the body's mass had been stopped there, which is at least as much as it is.
double energy_height(const Landscape& land, NearTable& near, const Vec& moments, const Throw& how,
                     const Motion& motion, const Vec& up) {
    const Vec& u = motion.velocity;
    const Vec& w = motion.spin;
    double twice = dot(u, u) + moments.x * w.x * w.x + moments.y * w.y * w.y +
                   moments.z * w.z * w.z;
    for (const Index v : near.at(up, motion.position.z)) {
        const double z = motion.position.z + dot(up, land.vertex[v]);
        if (z < 0.0) twice += how.contact.stiffness * z * z;
    }
    return motion.position.z + 0.5 * twice / how.gravity;
}

}  // namespace

Index advance(const Landscape& land, const Vec& moments, const Throw& how, Index steps,
              Motion& motion, Index& taken) {
    NearTable near(land);
    const Acceleration masses = {1.0, 1.0, 1.0, moments.x, moments.y, moments.z};
    const double brake = how.drag * sum(moments) / 3.0;
    const double h = how.step;
    Acceleration acceleration = {0.0, 0.0, -how.gravity, 0.0, 0.0, 0.0};
    Contact contacts[MOST_CONTACTS];
    bool as_mujoco = true;
    for (taken = 0; taken < steps; ++taken) {
        Vec& w = motion.spin;
        if (taken % STEPS_PER_CHECK == 0) {
            as_mujoco = 0.5 * twice_spin_energy(moments, w) < how.explicit_energy;
        }
        const Vec torque =
            (as_mujoco ? gyroscopic_torque(moments, w) : Vec{0.0, 0.0, 0.0}) - brake * w;
        const Acceleration free = {0.0,
                                   0.0,
                                   -how.gravity,
                                   torque.x / moments.x,
                                   torque.y / moments.y,
                                   torque.z / moments.z};
        const int count = motion.position.z < near.reach()
                              ? set_contacts(land, near, motion, how.contact, contacts)
                              : 0;
        if (count == 0) {
            std::copy(free, free + COORDINATES, acceleration);
        } else {
            // The last step's acceleration is a good first guess.
            solve_contacts(masses, free, acceleration, contacts, count, how.contact);
        }
        const double* a = acceleration;
        motion.velocity += h * Vec{a[0], a[1], a[2]};
        // Drag is implicit, so that any amount of it is stable.
        w += Vec{h * a[3] / (1.0 + h * brake / moments.x), h * a[4] / (1.0 + h * brake / moments.y),
                 h * a[5] / (1.0 + h * brake / moments.z)};
        motion.position += h * motion.velocity;
        if (as_mujoco) {
            turn(motion.turn, w, h);
        } else {
            rotate_freely(motion.turn, w, moments, h);
        }
        if ((taken + 1) % STEPS_PER_CHECK != 0) continue;
        const Vec up = Axes(motion.turn).row[2];
        const double height = energy_height(land, near, moments, how, motion, up);
        if (!std::isfinite(height + sum(up))) {
            ++taken;
            return STILL_MOVING;
        }
        if (height >= land.highest_barrier) continue;
        const Index rest = rest_below(land, -up);
        if (rest >= 0 && height < land.barrier[rest]) {
            ++taken;
            return rest;
        }
    }
    return STILL_MOVING;
}

}  // namespace dicedesign
