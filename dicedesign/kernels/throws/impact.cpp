#include "throws/impact.hpp"

#include <limits>

namespace dicedesign {
namespace {

// Turn of the slip in radians within which friction keeps its direction, in impacts and in stops.
// The error of an impulse is of second order in it.
constexpr double IMPACT_TURN = 0.04;
constexpr double STOP_TURN = 0.2;

// Change of the slip's length within a segment that turns, relative to the turn in radians.
constexpr double SLOWING = 2.0;

// Length of the last segment relative to what was expected at its begin.
constexpr double LAST_REACH = 1.05;

// Turning of a slip that stops, relative to its change and for a slip as fast as the point, below
// which it goes straight.
constexpr double STRAIGHT = 1e-5;

// Slip relative to the velocity before the impact below which a point sticks.
constexpr double STUCK = 1e-9;

// Segments after which a slip that still turns counts as stopped.
constexpr int MOST_SEGMENTS = 1000;

constexpr int MOST_NEWTON_STEPS = 50;
constexpr double NEWTON_TOLERANCE = 1e-14;  // of the length of a unit vector

constexpr double NEVER = std::numeric_limits<double>::infinity();

// Vector along the table.
struct Flat {
    double x, y;
};

Flat operator+(const Flat& a, const Flat& b) { return {a.x + b.x, a.y + b.y}; }

Flat operator*(double s, const Flat& a) { return {s * a.x, s * a.y}; }

double dot(const Flat& a, const Flat& b) { return a.x * b.x + a.y * b.y; }

double cross(const Flat& a, const Flat& b) { return a.x * b.y - a.y * b.x; }

double length(const Flat& a) { return std::sqrt(dot(a, a)); }

// (factor A + lambda)^-1 b, for A the response along the table.
Flat solve_along(const Response& k, double factor, double lambda, const Flat& b) {
    const double xx = factor * k.xx + lambda, xy = factor * k.xy, yy = factor * k.yy + lambda;
    const double over = 1.0 / (xx * yy - xy * xy);
    return {over * (yy * b.x - xy * b.y), over * (xx * b.y - xy * b.x)};
}

// The state of a point during its impact, as the normal impulse grows.
class Impact {
public:
    // segment_turn: see `IMPACT_TURN`.
    Impact(const Response& response, const Vec& velocity, double coefficient, double segment_turn)
        : k(response),
          friction(coefficient),
          turn(segment_turn),
          speed(norm(velocity)),
          aside{response.xz, response.yz},
          slip{velocity.x, velocity.y},
          normal(velocity.z) {}

    // Until the normal velocity is `target`.
    void compress(double target) {
        run([&](double rate) { return rate > 0.0 ? larger(target - normal, 0.0) / rate : NEVER; });
    }

    // Until the normal force has worked `share` of what it took.
    void restore(double share) {
        const double wanted = (1.0 - share) * work;
        run([&](double rate) {
            const double lacking = larger(wanted - work, 0.0);
            const double square = normal * normal + 2.0 * rate * lacking;
            if (!(square >= 0.0)) return NEVER;
            const double sum = normal + std::sqrt(square);
            return lacking == 0.0 ? 0.0 : sum > 0.0 ? 2.0 * lacking / sum : NEVER;
        });
    }

    Vec impulse() const { return {pushed.x, pushed.y, grown}; }

private:
    // Friction per normal impulse on a point that does not slip: what it takes to stick, or else
    // opposite to the one direction in which the slip can grow. That direction u has
    // (friction A + lambda) u = aside with lambda > 0, for A the response along the table; Newton's
    // method on 1 / |u| finds lambda from below.
    Flat hold() const {
        const Flat sticking = -1.0 * solve_along(k, 1.0, 0.0, aside);
        if (length(sticking) <= friction) return sticking;
        double lambda = larger(length(aside) - friction * (k.xx + k.yy), 0.0);
        Flat u = solve_along(k, friction, lambda, aside);
        for (int step = 0; step < MOST_NEWTON_STEPS; ++step) {
            const double size = length(u);
            if (!(size > 1.0 + NEWTON_TOLERANCE)) break;
            const Flat w = solve_along(k, friction, lambda, u);
            lambda += (size - 1.0) * dot(u, u) / dot(u, w);
            u = solve_along(k, friction, lambda, aside);
        }
        return (-friction / length(u)) * u;
    }

    double rate_of(const Flat& force) const { return k.zz + dot(aside, force); }

    Flat slip_rate(const Flat& force) const {
        return aside + Flat{k.xx * force.x + k.xy * force.y, k.xy * force.x + k.yy * force.y};
    }

    void grow(double amount, const Flat& force, const Flat& slip_change) {
        const double rate = rate_of(force);
        work += amount * (normal + 0.5 * rate * amount);
        normal += amount * rate;
        grown += amount;
        pushed = pushed + amount * force;
        slip = slip + amount * slip_change;
    }

    // Let the normal impulse grow until `left`, a function of the normal velocity's rate that says
    // by how much it still has to grow at that rate, is 0.
    template <class Left>
    void run(const Left& left) {
        for (int segment = 0; friction > 0.0; ++segment) {
            const double size = length(slip);
            if (size <= STUCK * speed || segment == MOST_SEGMENTS) {
                slip = {0.0, 0.0};
                break;
            }
            Flat force = (-friction / size) * slip;
            Flat change = slip_rate(force);
            const double along = dot(slip, change) / size;
            const double turning = std::fabs(cross(slip, change)) / size;
            double amount = left(rate_of(force));
            if (along < 0.0 && turning * size <= STRAIGHT * speed * length(change)) {
                const bool stops = size <= -along * amount;
                grow(stops ? size / -along : amount, force, change);
                if (!stops) return;
                slip = {0.0, 0.0};
                break;
            }
            const double most = turn * size / larger(turning, std::fabs(along) / SLOWING);
            double reach = amount <= most ? LAST_REACH * amount : most;
            amount = smaller(amount, most);
            Flat turned;
            double rest;
            for (;;) {
                const Flat halfway = slip + 0.5 * amount * change;
                force = (-friction / length(halfway)) * halfway;
                turned = slip_rate(force);
                rest = left(rate_of(force));
                const double segment = rest <= reach ? rest : amount;
                // Friction takes energy. In a segment where it would not, it turns the slip too
                // fast.
                if (!(dot(force, slip + 0.5 * segment * turned) > 0.0)) break;
                amount *= 0.5;
                reach = amount;
            }
            grow(rest <= reach ? rest : amount, force, turned);
            if (rest <= reach) return;
        }
        if (friction == 0.0) {
            const Flat none{0.0, 0.0};
            grow(left(k.zz), none, aside);
            return;
        }
        const Flat force = hold();
        grow(left(rate_of(force)), force, slip_rate(force));
    }

    const Response& k;
    double friction;
    double turn;
    double speed;  // before the impact
    Flat aside;
    Flat slip;
    double normal;
    double work = 0.0;   // of the normal force
    double grown = 0.0;  // normal impulse
    Flat pushed{0.0, 0.0};
};

}  // namespace

Vec impact(const Response& response, const Vec& velocity, const Surface& surface) {
    Impact point(response, velocity, surface.friction, IMPACT_TURN);
    point.compress(0.0);
    if (surface.restitution > 0.0) point.restore(surface.restitution * surface.restitution);
    return point.impulse();
}

Vec stop(const Response& response, const Vec& velocity, double friction, double target) {
    const Vec sticking = response.solve({-velocity.x, -velocity.y, target - velocity.z});
    if (friction * sticking.z >= length(Flat{sticking.x, sticking.y})) return sticking;
    Impact point(response, velocity, friction, STOP_TURN);
    point.compress(target);
    return point.impulse();
}

}  // namespace dicedesign
