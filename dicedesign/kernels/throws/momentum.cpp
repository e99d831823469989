#include "throws/momentum.hpp"

#include <algorithm>

#include "throws/momentum_chain.hpp"
#include "throws/tape.hpp"

namespace dicedesign {
namespace {

// Tensor of inertia of the uniform solid over its mass, about its own center of mass.
//
// Source: second moments of a tetrahedron, as in dicedesign/geometry/triangles.py.
template <class Real>
Symmetric<Real> inertia_of(const Hull& hull, const std::vector<Vector<Real>>& vertices) {
    // From near the middle, so that little cancels.
    Vec middle{0.0, 0.0, 0.0};
    for (const Vector<Real>& vertex : vertices) middle += value_of(vertex);
    middle = (1.0 / static_cast<double>(vertices.size())) * middle;
    std::vector<Vector<Real>> arms;
    for (const Vector<Real>& vertex : vertices) {
        arms.push_back(vertex - Vector<Real>{middle.x, middle.y, middle.z});
    }
    const Real none = 0.0;
    Real volume = none;
    Vector<Real> moment{none, none, none};
    Symmetric<Real> second{none, none, none, none, none, none};
    for (Index f = 0; f < hull.facet_count; ++f) {
        const auto arm = [&](Index i) { return arms[static_cast<std::size_t>(hull.tail[i])]; };
        for (Index i = hull.facet_start[f] + 2; i < hull.facet_start[f + 1]; ++i) {
            const Vector<Real> a = arm(hull.facet_start[f]), b = arm(i - 1), c = arm(i);
            const Real part = dot(a, cross(b, c));
            const Vector<Real> sum = a + b + c;
            const Vector<Real> x{a.x, b.x, c.x}, y{a.y, b.y, c.y}, z{a.z, b.z, c.z};
            volume += part;
            moment = moment + part * sum;
            second[0] += part * (dot(x, x) + sum.x * sum.x);
            second[1] += part * (dot(y, y) + sum.y * sum.y);
            second[2] += part * (dot(z, z) + sum.z * sum.z);
            second[3] += part * (dot(x, y) + sum.x * sum.y);
            second[4] += part * (dot(y, z) + sum.y * sum.z);
            second[5] += part * (dot(z, x) + sum.z * sum.x);
        }
    }
    const Real quarter = Real(0.25) / volume, twentieth = Real(0.05) / volume;
    const Vector<Real> c = quarter * moment;
    const Real xx = twentieth * second[0] - c.x * c.x, yy = twentieth * second[1] - c.y * c.y,
               zz = twentieth * second[2] - c.z * c.z;
    return {yy + zz,
            zz + xx,
            xx + yy,
            c.x * c.y - twentieth * second[3],
            c.y * c.z - twentieth * second[4],
            c.z * c.x - twentieth * second[5]};
}

std::vector<Vec> corners_of(const Hull& hull) {
    return {hull.vertices, hull.vertices + hull.vertex_count};
}

Vector<Traced> leaf(const Vec& a, Tape& tape) {
    return {Traced(a.x, &tape), Traced(a.y, &tape), Traced(a.z, &tape)};
}

}  // namespace

std::vector<double> throw_probabilities(const Landing& landing, const Momentum& model, const Vec& center,
                                const Symmetric<double>& inertia, const double* probabilities) {
    return landing_probabilities<double>(landing, model, corners_of(landing.hull), center, inertia,
                                {probabilities, probabilities + landing.paths.rests});
}

Symmetric<double> solid_inertia(const Hull& hull) {
    return inertia_of<double>(hull, corners_of(hull));
}

void pull_back_throw_probabilities(const Landing& landing, const Momentum& model, const Vec& center,
                           const double* probabilities, const double* weights, std::size_t count,
                           double* by_corners, double* by_center, double* by_probabilities) {
    // The places on the tape are those of the corners, the center, the probabilities before and the rest.
    Tape tape;
    std::vector<Vector<Traced>> vertices;
    for (const Vec& corner : corners_of(landing.hull)) vertices.push_back(leaf(corner, tape));
    const Vector<Traced> middle = leaf(center, tape);
    std::vector<Traced> resting;
    for (Index i = 0; i < landing.paths.rests; ++i) resting.emplace_back(probabilities[i], &tape);
    const std::vector<Traced> thrown = landing_probabilities<Traced>(
        landing, model, vertices, middle, inertia_of(landing.hull, vertices), resting);
    const std::size_t rests = resting.size(), coordinates = 3 * vertices.size();
    std::vector<double> gradients;
    for (std::size_t row = 0; row < count; row += Tape::WIDTH) {
        const std::size_t width = std::min(count - row, Tape::WIDTH);
        gradients.assign(Tape::WIDTH * tape.size(), 0.0);
        for (std::size_t i = 0; i < rests; ++i) {
            double* const to = gradients.data() + Tape::WIDTH * thrown[i].place;
            for (std::size_t j = 0; j < width; ++j) to[j] = weights[rests * (row + j) + i];
        }
        tape.sweep(gradients);
        const auto copy = [&](std::size_t place, std::size_t columns, double* rows) {
            for (std::size_t j = 0; j < width; ++j) {
                for (std::size_t i = 0; i < columns; ++i) {
                    rows[columns * (row + j) + i] = gradients[Tape::WIDTH * (place + i) + j];
                }
            }
        };
        copy(0, coordinates, by_corners);
        copy(coordinates, 3, by_center);
        copy(coordinates + 3, rests, by_probabilities);
    }
}

}  // namespace dicedesign
