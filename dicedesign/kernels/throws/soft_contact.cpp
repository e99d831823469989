#include "throws/soft_contact.hpp"

#include <algorithm>
#include <cmath>

namespace dicedesign {
namespace {

constexpr int MOST_STEPS = 50;
constexpr int MOST_TURNS = 12;
constexpr double TURN_TOLERANCE = 1e-9;  // relative to what a point misses without a force
constexpr int MOST_HALVINGS = 40;
constexpr double GRADIENT_TOLERANCE = 1e-16;  // squared, relative to weight and cost
constexpr double SUFFICIENT_DECREASE = 1e-4;
constexpr double NEGLIGIBLE_SLOPE = 1e-14;  // relative to the cost

// Cost of a contact at `missed`, with its forces and curvature. Frictionless ones have one row.
double contact_cost(Contact& c, double weight, double friction) {
    double* f = c.force;
    const double* m = c.missed;
    std::fill(&c.curvature[0][0], &c.curvature[0][0] + 9, 0.0);
    f[0] = f[1] = f[2] = 0.0;
    c.active = true;
    if (friction == 0.0) {
        c.active = m[0] < 0.0;
        if (!c.active) return 0.0;
        c.curvature[0][0] = weight;
        f[0] = -weight * m[0];
        return 0.5 * weight * m[0] * m[0];
    }
    const double sliding = std::sqrt(m[1] * m[1] + m[2] * m[2]);
    if (m[0] >= friction * sliding) {
        c.active = false;
        return 0.0;
    }
    if (friction * m[0] + sliding <= 0.0) {  // sticks
        for (int r = 0; r < 3; ++r) {
            f[r] = -weight * m[r];
            c.curvature[r][r] = weight;
        }
        return 0.5 * weight * (m[0] * m[0] + sliding * sliding);
    }
    // Slides: the cost is half the squared distance from the cone.
    const double w = weight / (1.0 + friction * friction);
    const double beyond = m[0] - friction * sliding;
    const double e1 = m[1] / sliding, e2 = m[2] / sliding;
    const double along = w * friction * friction, across = -w * beyond * friction / sliding;
    f[0] = -w * beyond;
    f[1] = w * beyond * friction * e1;
    f[2] = w * beyond * friction * e2;
    c.curvature[0][0] = w;
    c.curvature[0][1] = c.curvature[1][0] = -w * friction * e1;
    c.curvature[0][2] = c.curvature[2][0] = -w * friction * e2;
    c.curvature[1][1] = along * e1 * e1 + across * e2 * e2;
    c.curvature[2][2] = along * e2 * e2 + across * e1 * e1;
    c.curvature[1][2] = c.curvature[2][1] = (along - across) * e1 * e2;
    return 0.5 * w * beyond * beyond;
}

// The function that is minimized, and its gradient.
double cost_of(const Acceleration masses, const Acceleration free, const Acceleration at,
               Contact* contacts, int count, double weight, double friction,
               Acceleration gradient) {
    double cost = 0.0;
    for (int i = 0; i < COORDINATES; ++i) {
        const double excess = at[i] - free[i];
        gradient[i] = masses[i] * excess;
        cost += 0.5 * gradient[i] * excess;
    }
    for (Contact* c = contacts; c != contacts + count; ++c) {
        for (int r = 0; r < 3; ++r) {
            double had = 0.0;
            for (int i = 0; i < COORDINATES; ++i) had += c->rows[r][i] * at[i];
            c->missed[r] = had - c->wanted[r];
        }
        cost += contact_cost(*c, weight, friction);
        if (!c->active) continue;
        for (int r = 0; r < 3; ++r) {
            for (int i = 0; i < COORDINATES; ++i) gradient[i] -= c->rows[r][i] * c->force[r];
        }
    }
    return cost;
}

// Newton's direction -H^-1 gradient, with H positive definite, by Cholesky's factors.
void newton_direction(const Acceleration masses, const Acceleration gradient,
                      const Contact* contacts, int count, Acceleration direction) {
    double h[COORDINATES][COORDINATES] = {};
    for (int i = 0; i < COORDINATES; ++i) h[i][i] = masses[i];
    for (const Contact* c = contacts; c != contacts + count; ++c) {
        if (!c->active) continue;
        for (int i = 0; i < COORDINATES; ++i) {
            double x[3];
            for (int s = 0; s < 3; ++s) {
                x[s] = c->rows[0][i] * c->curvature[0][s] + c->rows[1][i] * c->curvature[1][s] +
                       c->rows[2][i] * c->curvature[2][s];
            }
            for (int j = 0; j <= i; ++j) {
                h[i][j] += x[0] * c->rows[0][j] + x[1] * c->rows[1][j] + x[2] * c->rows[2][j];
            }
        }
    }
    for (int i = 0; i < COORDINATES; ++i) {
        for (int j = 0; j <= i; ++j) {
            double s = h[i][j];
            for (int k = 0; k < j; ++k) s -= h[i][k] * h[j][k];
            h[i][j] = i == j ? std::sqrt(s) : s / h[j][j];
        }
    }
    for (int i = 0; i < COORDINATES; ++i) {
        double s = -gradient[i];
        for (int k = 0; k < i; ++k) s -= h[i][k] * direction[k];
        direction[i] = s / h[i][i];
    }
    for (int i = COORDINATES - 1; i >= 0; --i) {
        double s = direction[i];
        for (int k = i + 1; k < COORDINATES; ++k) s -= h[k][i] * direction[k];
        direction[i] = s / h[i][i];
    }
}

// One contact in place of all of the body: what its point misses without a force, (3,), and how a
// force accelerates the point.
struct OneContact {
    Vec without;
    Vec response[3];  // rows of a symmetric matrix
    double weight, friction;

    Vec accelerated(const Vec& force) const {
        return {dot(response[0], force), dot(response[1], force), dot(response[2], force)};
    }

    // The force that a point needs to stick. Returns whether friction is enough for it.
    bool sticks(Vec& force) const {
        const Vec a = Vec{1.0, 0.0, 0.0} + weight * response[0],
                  b = Vec{0.0, 1.0, 0.0} + weight * response[1],
                  c = Vec{0.0, 0.0, 1.0} + weight * response[2];
        const Vec bc = cross(b, c), da = cross(without, a);
        const double part = -weight / dot(a, bc);
        force = {part * dot(without, bc), -part * dot(c, da), part * dot(b, da)};
        return friction * force.x >= std::sqrt(force.y * force.y + force.z * force.z);
    }

    // The force of a point that slides: it is on the friction cone, against the direction of what
    // the point misses along the table. Newton's method finds it in its angle. Returns false if
    // it does not converge.
    bool slides(Vec& force) const {
        const double w = weight / (1.0 + friction * friction);
        const double lift = -weight * without.x / (1.0 + weight * response[0].x);
        Vec along = without + lift * response[0];  // as if there were no friction
        const double size = norm(without);
        for (int step = 0; step < MOST_TURNS; ++step) {
            const double length = std::sqrt(along.y * along.y + along.z * along.z);
            if (!(length > 0.0)) return false;
            const Vec e{0.0, along.y / length, along.z / length}, across{0.0, -e.z, e.y};
            const Vec cone{1.0, -friction * e.y, -friction * e.z}, turned = -friction * across;
            const Vec pushed = accelerated(cone);
            const double stiff = 1.0 + w * dot(cone, pushed);
            const double load = -w * dot(cone, without) / stiff;
            const Vec missed = without + load * pushed;
            force = load * cone;
            const double aside = dot(across, missed), ahead = dot(e, missed);
            if (std::abs(aside) <= TURN_TOLERANCE * size) return load >= 0.0 && ahead >= 0.0;
            const double change =
                -w * (dot(turned, without) + 2.0 * load * dot(turned, pushed)) / stiff;
            const double slope =
                dot(across, change * pushed + load * accelerated(turned)) - ahead;
            // Where Newton's step leads nowhere: on to the direction that there is now.
            const bool turns = slope < 0.0 && std::abs(aside) < -slope;
            along = turns ? e - (aside / slope) * across : missed;
        }
        return false;
    }
};

// The same for one contact. Returns false where its force is not found.
bool solve_one(const Acceleration masses, const Acceleration free, Acceleration acceleration,
               const Contact& c, double weight, double friction) {
    double without[3], response[3][3], eased[3][COORDINATES];
    for (int r = 0; r < 3; ++r) {
        without[r] = -c.wanted[r];
        for (int i = 0; i < COORDINATES; ++i) {
            without[r] += c.rows[r][i] * free[i];
            eased[r][i] = c.rows[r][i] / masses[i];
        }
        for (int s = 0; s <= r; ++s) {
            double sum = 0.0;
            for (int i = 0; i < COORDINATES; ++i) sum += c.rows[s][i] * eased[r][i];
            response[r][s] = response[s][r] = sum;
        }
    }
    OneContact point{{without[0], without[1], without[2]}, {}, weight, friction};
    for (int r = 0; r < 3; ++r) {
        point.response[r] = {response[r][0], response[r][1], response[r][2]};
    }
    Vec force{0.0, 0.0, 0.0};
    const double sliding = std::sqrt(without[1] * without[1] + without[2] * without[2]);
    if (without[0] < friction * sliding && !point.sticks(force) && !point.slides(force)) {
        return false;
    }
    for (int i = 0; i < COORDINATES; ++i) {
        acceleration[i] =
            free[i] + eased[0][i] * force.x + eased[1][i] * force.y + eased[2][i] * force.z;
    }
    return true;
}

// Go to where all points stick, if that is better. Where they do it is the answer.
void stick_all(const Acceleration masses, const Acceleration free, Acceleration acceleration,
               Contact* contacts, int count, double weight, double friction,
               Acceleration gradient, double& cost) {
    Acceleration slope, direction, tried, tried_gradient;
    for (int i = 0; i < COORDINATES; ++i) slope[i] = masses[i] * (acceleration[i] - free[i]);
    for (Contact* c = contacts; c != contacts + count; ++c) {
        c->active = true;
        std::fill(&c->curvature[0][0], &c->curvature[0][0] + 9, 0.0);
        for (int r = 0; r < 3; ++r) {
            c->curvature[r][r] = weight;
            for (int i = 0; i < COORDINATES; ++i) slope[i] += weight * c->missed[r] * c->rows[r][i];
        }
    }
    newton_direction(masses, slope, contacts, count, direction);
    for (int i = 0; i < COORDINATES; ++i) tried[i] = acceleration[i] + direction[i];
    const double tried_cost =
        cost_of(masses, free, tried, contacts, count, weight, friction, tried_gradient);
    if (tried_cost < cost) {
        std::copy(tried, tried + COORDINATES, acceleration);
        std::copy(tried_gradient, tried_gradient + COORDINATES, gradient);
        cost = tried_cost;
    } else {
        cost = cost_of(masses, free, acceleration, contacts, count, weight, friction, gradient);
    }
}

double product(const Acceleration a, const Acceleration b) {
    double s = 0.0;
    for (int i = 0; i < COORDINATES; ++i) s += a[i] * b[i];
    return s;
}

}  // namespace

void solve_contacts(const Acceleration masses, const Acceleration free, Acceleration acceleration,
                    Contact* contacts, int count, const ContactModel& model) {
    const double weight = model.impedance / (1.0 - model.impedance);
    if (count == 1 && solve_one(masses, free, acceleration, *contacts, weight, model.friction)) {
        return;
    }
    Acceleration gradient;
    double cost = cost_of(masses, free, acceleration, contacts, count, weight, model.friction,
                          gradient);
    stick_all(masses, free, acceleration, contacts, count, weight, model.friction, gradient, cost);
    double weighed = 0.0;
    for (int i = 0; i < COORDINATES; ++i) weighed += masses[i] * free[i] * free[i];
    for (int step = 0; step < MOST_STEPS; ++step) {
        double squared = 0.0;
        for (int i = 0; i < COORDINATES; ++i) squared += gradient[i] * gradient[i] / masses[i];
        if (squared <= GRADIENT_TOLERANCE * (weighed + cost)) return;
        Acceleration direction;
        newton_direction(masses, gradient, contacts, count, direction);
        const double slope = product(gradient, direction);
        double length = 1.0;
        bool moved = false;
        for (int halving = 0; halving < MOST_HALVINGS && !moved; ++halving) {
            Acceleration tried, tried_gradient;
            for (int i = 0; i < COORDINATES; ++i) {
                tried[i] = acceleration[i] + length * direction[i];
            }
            const double tried_cost = cost_of(masses, free, tried, contacts, count, weight,
                                              model.friction, tried_gradient);
            if (tried_cost <= cost + SUFFICIENT_DECREASE * length * slope ||
                -slope <= NEGLIGIBLE_SLOPE * cost) {
                std::copy(tried, tried + COORDINATES, acceleration);
                std::copy(tried_gradient, tried_gradient + COORDINATES, gradient);
                cost = tried_cost;
                moved = true;
            }
            // To where the slope would vanish if it were linear.
            const double root = length * slope / (slope - product(tried_gradient, direction));
            length = root > 0.1 * length && root < 0.9 * length ? root : 0.5 * length;
        }
        if (!moved) return;  // as near as rounding lets it come
    }
}

}  // namespace dicedesign
