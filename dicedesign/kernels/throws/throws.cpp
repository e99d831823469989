#include "throws/throws.hpp"

#include <algorithm>
#include <cmath>

#include "throws/flight.hpp"
#include "throws/free_rotation.hpp"
#include "throws/near_table.hpp"

namespace dicedesign {
namespace {

constexpr Index STEPS_PER_CHECK = 16;

constexpr double LONGEST_FLIGHT = 1e9;  // steps at once

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
int set_contacts(const Landscape& land, NearTable& near, const Axes& axes, const Motion& motion,
                 const ContactModel& model, Contact* contacts) {
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

// Height to which all energy would lift the center of mass. What is stored in contacts counts as if
// all of the body's mass had been stopped there, which is at least as much as it is.
double energy_height(const Landscape& land, NearTable& near, const Vec& moments, const Throw& how,
                     const Motion& motion, const Vec& up) {
    double twice = twice_kinetic_energy(moments, motion);
    for (const Index v : near.at(up, motion.position.z)) {
        const double z = motion.position.z + dot(up, land.vertex[v]);
        if (z < 0.0) twice += how.contact.stiffness * z * z;
    }
    return motion.position.z + 0.5 * twice / how.gravity;
}

// Number of steps that a body with all vertices above the table may take at once: no vertex gets
// below it in between.
Index steps_of_flight(const Landscape& land, const Vec& moments, const Throw& how,
                      const Motion& motion, const Vec& up, double reach) {
    const FlightBounds bounds(moments, how.gravity, motion.spin, reach);
    // A step falls further by half of its gain in speed.
    const double rising = motion.velocity.z - 0.5 * how.gravity * how.step;
    const double safe =
        time_of_flight(land, bounds, how.gravity, motion, rising, up, reach,
                       LONGEST_FLIGHT * how.step, [](double, double) { return false; });
    const bool finite =
        std::isfinite(motion.position.z + bounds.fastest + sum(up) + sum(motion.velocity));
    return finite ? static_cast<Index>(safe / how.step) : 0;
}

// Free flight for a number of steps at once.
void fly(const Vec& moments, const Throw& how, Index steps, Motion& motion) {
    const double count = static_cast<double>(steps), seconds = count * how.step;
    motion.position += seconds * motion.velocity;
    motion.position.z -= 0.5 * how.gravity * how.step * (seconds + how.step) * count;
    motion.velocity.z -= how.gravity * seconds;
    rotate_freely(motion.turn, motion.spin, moments, seconds);
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
    Index unchecked = 0;
    for (taken = 0; taken < steps;) {
        Vec& w = motion.spin;
        const Axes axes(motion.turn);
        const bool is_high = motion.position.z >= near.reach();
        const int count =
            is_high ? 0 : set_contacts(land, near, axes, motion, how.contact, contacts);
        Index safe = 0;
        if (count == 0 && brake == 0.0) {
            safe = steps_of_flight(land, moments, how, motion, axes.row[2], near.reach());
        }
        const Index together = safe > 0 ? std::min(safe, steps - taken) : 1;
        if (safe > 0) {
            fly(moments, how, together, motion);
        } else {
            const Acceleration free = {0.0,
                                       0.0,
                                       -how.gravity,
                                       -brake * w.x / moments.x,
                                       -brake * w.y / moments.y,
                                       -brake * w.z / moments.z};
            if (count == 0) {
                std::copy(free, free + COORDINATES, acceleration);
            } else {
                // The last step's acceleration is a good first guess.
                solve_contacts(masses, free, acceleration, contacts, count, how.contact);
            }
            const double* a = acceleration;
            motion.velocity += h * Vec{a[0], a[1], a[2]};
            // Drag is implicit, so that any amount of it is stable.
            w += Vec{h * a[3] / (1.0 + h * brake / moments.x),
                     h * a[4] / (1.0 + h * brake / moments.y),
                     h * a[5] / (1.0 + h * brake / moments.z)};
            motion.position += h * motion.velocity;
            rotate_freely(motion.turn, w, moments, h);
        }
        taken += together;
        unchecked += together;
        if (unchecked < STEPS_PER_CHECK) continue;
        unchecked = 0;
        const Vec up = Axes(motion.turn).row[2];
        const double height = energy_height(land, near, moments, how, motion, up);
        if (!std::isfinite(height + sum(up))) return STILL_MOVING;
        const Index rest = certain_rest(land, -up, height);
        if (rest != STILL_MOVING) return rest;
    }
    return STILL_MOVING;
}

}  // namespace dicedesign
