#include "throws/throws.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "throws/flight.hpp"
#include "throws/free_rotation.hpp"
#include "throws/near_table.hpp"

namespace dicedesign {
namespace {

// Slow approaches have no restitution: those below the speed that gravity gives in this many steps.
constexpr double SLOW_STEPS = 1.0;

// Smallest time from one event to the next, in steps. It bounds how deep a vertex gets below the
// table before its impact.
constexpr double LEAST_STEP = 1.0 / 64.0;

// Turn in radians of a body within a step on the table.
constexpr double MOST_TURN = 0.05;

// Impacts at one time after which all others are without restitution, and after which they end.
constexpr int MOST_IMPACTS = 64;
constexpr int MOST_STOPS = 128;

// Approach that is left to a vertex at rest, relative to the speed that gravity gives in a step;
// and in a step that gains energy with it, as of a body that almost stands on an edge.
constexpr double STOP_TOLERANCE = 1e-3;
constexpr double FINE_TOLERANCE = 1e-9;

// Energy is compared with barriers after this many events on the table.
constexpr int EVENTS_PER_CHECK = 4;

// Energy that a sliding body may gain in impacts of its back, over the energy of its tilting.
constexpr double SAFE_ENERGY = 4.0;

// A vertex at or near the table.
struct Touching {
    double height;
    Vec turning[3];  // change of its velocity along the table's x, y and z by the body's spin
    Response response;
    Vec impulse;     // of this step
};

class ThrownBody {
public:
    ThrownBody(const Landscape& landscape, const Vec& principal, const Throw& throw_,
               Motion& moving)
        : land(landscape),
          moments(principal),
          how(throw_),
          motion(moving),
          near(landscape),
          brake(throw_.drag * sum(principal) / 3.0),
          slow(SLOW_STEPS * throw_.gravity * throw_.step) {}

    // Move for `most` seconds, or until the rest is certain or the motion not finite.
    Index move(double most, double& elapsed) {
        int events = 0;
        for (elapsed = 0.0; elapsed < most;) {
            const Axes axes(motion.turn);
            if (!std::isfinite(energy_height() + sum(axes.row[2]))) return STILL_MOVING;
            find_touching(axes, moments);
            const bool bounces = bounce();
            const double seconds = smaller(safe_time(axes.row[2]), most - elapsed);
            if (held) {
                stay(seconds);
            } else {
                fly(seconds);
            }
            elapsed += seconds;
            if (!(bounces || held) || ++events < EVENTS_PER_CHECK) continue;
            events = 0;
            const Index rest = certain_rest();
            if (rest != STILL_MOVING) return rest;
        }
        return STILL_MOVING;
    }

private:
    double energy_height() const {
        return motion.position.z + 0.5 * twice_kinetic_energy(moments, motion) / how.gravity;
    }

    // The rest that the body cannot miss any more, or STILL_MOVING: its energy, as the height to
    // which it would lift the center of mass, is below all saddles of the border of the basin that
    // it is in, or it slides to a stop there.
    Index certain_rest() const {
        const Vec up = Axes(motion.turn).row[2];
        const double energy = energy_height(), highest = land.highest_barrier;
        if (energy >= highest && !(held && tilting_height(up) < highest)) return STILL_MOVING;
        const Index rest = rest_below(land, -up);
        if (rest < 0) return STILL_MOVING;
        const bool stays = energy < land.barrier[rest];
        return stays || (held && slides_to_rest(land.flat + 3 * rest, up)) ? rest : STILL_MOVING;
    }

    // The energy without that of sliding and of the spin about the vertical.
    double tilting_height(const Vec& up) const {
        const Vec tilting = motion.spin - dot(up, motion.spin) * up;
        const double rising = motion.velocity.z * motion.velocity.z;
        return motion.position.z + 0.5 * (rising + twice_spin_energy(moments, tilting)) / how.gravity;
    }

    // Whether a body on the table slides and spins to a stop without tipping. Sliding friction and
    // the table's force together have one direction, which is that of gravity for an observer who
    // slows down with the body: for him it tips once its center of mass is above the edge ahead.
    // Spinning about an axis that is no principal one moves that edge nearer.
    bool slides_to_rest(const double* flat, const Vec& up) const {
        const double height = flat[0], friction = how.surface.friction;
        const double spin = dot(up, motion.spin);
        const double width = flat[1] - spin * spin * flat[2] / how.gravity;
        const double angle = std::atan2(width, height) - std::atan(friction);
        if (!(angle > 0.0)) return false;
        const double climb =
            std::hypot(width, height) * std::hypot(1.0, friction) * (1.0 - std::cos(angle));
        return SAFE_ENERGY * (tilting_height(up) - height) < climb;
    }

    // Height below which a slow vertex is held at the table.
    double held_height() const { return slow * how.step; }

    bool is_held(double z, double speed) const {
        return z <= held_height() && std::fabs(speed) <= slow;
    }

    // Vertices that may touch the table, for a body with moments of inertia `inertia`.
    void find_touching(const Axes& axes, const Vec& inertia) {
        touching.clear();
        const double height = motion.position.z;
        if (height >= near.reach() + held_height()) return;
        for (const Index v : near.at(axes.row[2], height - held_height())) {
            const double z = height + dot(axes.row[2], land.vertex[v]);
            if (z > held_height()) continue;
            Touching point{z, {}, {}, {0.0, 0.0, 0.0}};
            Vec eased[3];
            for (int r = 0; r < 3; ++r) {
                const Vec turning = cross(land.vertex[v], axes.row[r]);
                point.turning[r] = turning;
                eased[r] = {turning.x / inertia.x, turning.y / inertia.y, turning.z / inertia.z};
            }
            const auto product = [&](int r, int s) { return dot(point.turning[r], eased[s]); };
            point.response = {1.0 + product(0, 0), product(0, 1), 1.0 + product(1, 1),
                              product(0, 2),       product(1, 2), 1.0 + product(2, 2)};
            touching.push_back(point);
        }
    }

    double normal_speed(const Touching& point) const {
        return motion.velocity.z + dot(point.turning[2], motion.spin);
    }

    Vec velocity(const Touching& point) const {
        return {motion.velocity.x + dot(point.turning[0], motion.spin),
                motion.velocity.y + dot(point.turning[1], motion.spin), normal_speed(point)};
    }

    void push(const Touching& point, const Vec& impulse, const Vec& inertia) {
        motion.velocity += impulse;
        const Vec torque = impulse.x * point.turning[0] + impulse.y * point.turning[1] +
                           impulse.z * point.turning[2];
        motion.spin += {torque.x / inertia.x, torque.y / inertia.y, torque.z / inertia.z};
    }

    // The vertex with the largest excess, a function of vertices, above `least`, or none.
    template <class Excess>
    Touching* worst(double least, const Excess& excess) {
        Touching* found = nullptr;
        for (Touching& point : touching) {
            const double here = excess(point);
            if (here > least) {
                least = here;
                found = &point;
            }
        }
        return found;
    }

    // Impacts of vertices on the table. Returns whether there were any.
    bool bounce() {
        const double before = energy_height();
        int count = 0;
        for (; count < MOST_STOPS; ++count) {
            const Touching* const point = worst(slow, [this](const Touching& one) {
                return one.height <= 0.0 ? -normal_speed(one) : 0.0;
            });
            if (point == nullptr) break;
            const Vec speeds = velocity(*point);
            push(*point,
                 count < MOST_IMPACTS ? impact(point->response, speeds, how.surface)
                                      : stop(point->response, speeds, how.surface.friction, 0.0),
                 moments);
        }
        if (count > 0) lift(before - energy_height());
        return count > 0;
    }

    // Lift a body of which vertices are below the table, by at most `most`.
    void lift(double most) {
        double lowest = 0.0;
        for (const Touching& point : touching) lowest = smaller(lowest, point.height);
        const double height = larger(smaller(-lowest, most), 0.0);
        motion.position.z += height;
        for (Touching& point : touching) point.height += height;
    }

    // Time during which no vertex gets below the table but those that are held. Sets whether there
    // are any of these.
    double safe_time(const Vec& up) {
        held = false;
        for (const Touching& point : touching) {
            held = held || is_held(point.height, normal_speed(point));
        }
        const FlightBounds bounds(moments, how.gravity, motion.spin, near.reach(), brake);
        const double turns = bounds.fastest * how.step * how.step;
        double most = std::numeric_limits<double>::infinity();
        if (held) {
            most = turns > MOST_TURN * MOST_TURN ? MOST_TURN / std::sqrt(bounds.fastest) : how.step;
        } else if (brake > 0.0) {
            most = how.step;
        }
        const double safe = time_of_flight(
            land, bounds, how.gravity, motion, up, near.reach(), most,
            [this](double z, double speed) { return is_held(z, speed); });
        return larger(safe, LEAST_STEP * how.step);
    }

    // Moments of inertia that resist a torque within a time: drag is implicit, so that any amount
    // of it is stable.
    Vec braked(double seconds) const {
        const double more = seconds * brake;
        return {moments.x + more, moments.y + more, moments.z + more};
    }

    void drag(const Vec& inertia) {
        Vec& w = motion.spin;
        w = {w.x * moments.x / inertia.x, w.y * moments.y / inertia.y, w.z * moments.z / inertia.z};
    }

    void fly(double seconds) {
        if (brake > 0.0) drag(braked(seconds));
        motion.position += seconds * motion.velocity;
        motion.position.z -= 0.5 * how.gravity * seconds * seconds;
        motion.velocity.z -= how.gravity * seconds;
        rotate_freely(motion.turn, motion.spin, moments, seconds);
    }

    // Push held vertices so that they get no lower than the table within a time, up to a speed
    // `tolerance`. Each vertex's impulse is found given those of the others, until all fit.
    void hold(double seconds, const Vec& inertia, double tolerance) {
        const auto target = [&](const Touching& point) {
            return -larger(point.height, 0.0) / seconds;
        };
        // Of an approach, and of a vertex that the others' impulses lift.
        const auto excess = [&](const Touching& point) {
            const double speed = normal_speed(point) - target(point);
            return point.impulse.z > 0.0 ? std::fabs(speed) : -speed;
        };
        for (int count = 0; count < MOST_STOPS; ++count) {
            Touching* const point = worst(tolerance, excess);
            if (point == nullptr) return;
            const Vec without = velocity(*point) - point->response * point->impulse;
            const Vec impulse =
                without.z < target(*point)
                    ? stop(point->response, without, how.surface.friction, target(*point))
                    : Vec{0.0, 0.0, 0.0};
            push(*point, impulse - point->impulse, inertia);
            point->impulse = impulse;
        }
    }

    // A step on the table: half of the motion, gravity and the impulses that hold vertices, the
    // other half. In free flight that is exact, and a body that is held loses no energy.
    void stay(double seconds) {
        const double gained = how.gravity * seconds;
        const Vec inertia = braked(seconds);
        // Twice the energies are above the height halfway.
        const double before = twice_kinetic_energy(moments, motion) - gained * motion.velocity.z;
        const auto lost = [&] {
            return before - twice_kinetic_energy(moments, motion) - gained * motion.velocity.z;
        };
        glide(0.5 * seconds);
        find_touching(Axes(motion.turn), inertia);
        const auto is_fast = [&](const Touching& one) { return normal_speed(one) < -slow; };
        touching.erase(std::remove_if(touching.begin(), touching.end(), is_fast), touching.end());
        motion.velocity.z -= gained;
        if (brake > 0.0) drag(inertia);
        hold(0.5 * seconds, inertia, STOP_TOLERANCE * gained);
        if (lost() < 0.0) hold(0.5 * seconds, inertia, FINE_TOLERANCE * gained);
        if (lost() < 0.0) slow_down(before, gained);
        const double height = 0.5 * lost() / how.gravity;
        glide(0.5 * seconds);
        if (height > 0.0) {
            lift(height);
        } else {
            motion.position.z += height;
        }
    }

    // Scale all velocities so that the energy is at most `twice_energy` / 2 after half a step, in
    // which gravity takes half of the speed `gained`.
    void slow_down(double twice_energy, double gained) {
        // Twice the energy after the half is a x^2 + 2 b x for a factor x.
        const double a = twice_kinetic_energy(moments, motion);
        const double b = 0.5 * gained * motion.velocity.z;
        const double root = std::sqrt(larger(b * b + a * twice_energy, 0.0));
        const double factor = twice_energy > 0.0 || b < 0.0 ? (root - b) / a : 0.0;
        motion.velocity = factor * motion.velocity;
        motion.spin = factor * motion.spin;
    }

    // Motion without forces.
    void glide(double seconds) {
        motion.position += seconds * motion.velocity;
        rotate_freely(motion.turn, motion.spin, moments, seconds);
    }

    const Landscape& land;
    const Vec& moments;
    const Throw& how;
    Motion& motion;
    NearTable near;
    double brake;
    double slow;
    std::vector<Touching> touching;
    bool held = false;
};

}  // namespace

Index advance(const Landscape& land, const Vec& moments, const Throw& how, Index steps,
              Motion& motion, Index& taken) {
    double elapsed = 0.0;
    const double most = static_cast<double>(steps) * how.step;
    const Index rest = ThrownBody(land, moments, how, motion).move(most, elapsed);
    taken = std::min(steps, static_cast<Index>(std::ceil(elapsed / how.step)));
    return rest;
}

}  // namespace dicedesign
