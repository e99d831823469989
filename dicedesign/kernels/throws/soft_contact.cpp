#include "throws/soft_contact.hpp"

#include <algorithm>
#include <cmath>

namespace dicedesign {
namespace {

constexpr int MOST_STEPS = 50;
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

// The function that is minimised, and its gradient.
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

double product(const Acceleration a, const Acceleration b) {
    double s = 0.0;
    for (int i = 0; i < COORDINATES; ++i) s += a[i] * b[i];
    return s;
}

}  // namespace

void solve_contacts(const Acceleration masses, const Acceleration free, Acceleration acceleration,
                    Contact* contacts, int count, const ContactModel& model) {
    const double weight = model.impedance / (1.0 - model.impedance);
    Acceleration gradient;
    double cost = cost_of(masses, free, acceleration, contacts, count, weight, model.friction,
                          gradient);
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
