// A hull and its center of mass, in doubles or in numbers of more digits.
#pragma once

#include <cmath>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "hull/hull.hpp"
#include "twofold.hpp"
#include "vector.hpp"
#include "wide.hpp"

namespace dicedesign {

// Bounds on rounding, and how far the center of mass may move without a change of decisions.
struct Tolerances {
    double rounding;      // ROUNDING of `dicedesign.tolerances`, for doubles
    double tie_distance;  // a length, 0 where ties are not looked for
};

inline double rounded(double a) { return a; }
inline double rounded(const Twofold& a) { return a.high; }
template <class Real>
inline Vec rounded(const Vector<Real>& a) {
    return {rounded(a.x), rounded(a.y), rounded(a.z)};
}

inline double difference(double a, double b, double) { return a - b; }
inline Twofold difference(double a, double b, const Twofold&) { return exact_sum(a, -b); }
template <int N>
Wide<N> difference(double a, double b, const Wide<N>&) {
    // Of points near each other the second part is 0.
    const Twofold exact = exact_sum(a, -b);
    return Wide<N>(exact.high) + Wide<N>(exact.low);
}

// Bound on the rounding of a kind of number, from the bound of doubles. One operation on twofold numbers
// is wrong by less than 2^-103 of its result, one on N limbs by less than 2^-(32 (N - 1)).
inline double rounding_of(double rounding, double) { return rounding; }
inline double rounding_of(double rounding, const Twofold&) { return 0x1p-50 * rounding; }
template <int N>
double rounding_of(double rounding, const Wide<N>&) {
    return std::ldexp(rounding, 53 - 32 * (N - 1));
}

template <class Real>
inline Vector<Real> difference(const Vec& a, const Vec& b) {
    const Real kind = Real();
    return {difference(a.x, b.x, kind), difference(a.y, b.y, kind), difference(a.z, b.z, kind)};
}

// Vectors of a hull as seen from the center of mass, and bounds on their errors.
template <class Real>
class Frame {
public:
    Frame(const Hull& hull, const Vec& center, const Tolerances& tolerances)
        : Frame(hull, center, tolerances, nullptr) {
        auto errors = std::make_shared<std::vector<double>>();
        errors->reserve(hull.facet_count);
        for (Index f = 0; f < hull.facet_count; ++f) errors->push_back(error(f));
        normal_errors_ = std::move(errors);
    }

    // r_p of a vertex.
    Vector<Real> radius(Index p) const { return difference<Real>(hull.vertices[p], center_); }

    // x_q - x_p of a half-edge.
    Vector<Real> edge(Index e) const {
        return difference<Real>(hull.vertices[hull.head[e]], hull.vertices[hull.tail[e]]);
    }

    // Outward normal of a facet, of length 1 or nearly so.
    Vector<Real> normal(Index f) const {
        if constexpr (std::is_same_v<Real, double>) {
            return hull.normals[f];
        } else {
            const Index start = hull.facet_start[f], end = hull.facet_start[f + 1];
            const Vec& anchor = hull.vertices[hull.tail[start]];
            Vector<Real> total{0.0, 0.0, 0.0};
            for (Index e = start + 1; e + 1 < end; ++e) {
                total = total + cross(difference<Real>(hull.vertices[hull.tail[e]], anchor),
                                      difference<Real>(hull.vertices[hull.head[e]], anchor));
            }
            return Real(0.5 / hull.areas[f]) * total;
        }
    }

    // Bound on the error of that normal, as a length.
    double normal_error(Index f) const {
        return (rounding / tolerances.rounding) * (*normal_errors_)[f];
    }

    // The same of the hull's own normal, and of a product with it in doubles.
    double normal_error_of_doubles(Index f) const { return (*normal_errors_)[f] + tolerances.rounding; }

    // This frame with more digits.
    template <class Finer>
    Frame<Finer> with() const {
        return Frame<Finer>(hull, center_, tolerances, normal_errors_);
    }

    const Hull& hull;
    const Tolerances tolerances;
    const double rounding;

private:
    template <class>
    friend class Frame;

    using Errors = std::shared_ptr<const std::vector<double>>;

    Frame(const Hull& hull, const Vec& center, const Tolerances& tolerances, Errors normal_errors)
        : hull(hull), tolerances(tolerances),
          rounding(rounding_of(tolerances.rounding, Real())), center_(center),
          normal_errors_(std::move(normal_errors)) {}

    double error(Index f) const {
        const Index start = hull.facet_start[f], end = hull.facet_start[f + 1];
        const Vec anchor = hull.vertices[hull.tail[start]];
        double size = 0.0;
        for (Index e = start; e < end; ++e) {
            const Vec a = absolute(hull.vertices[hull.tail[e]] - anchor);
            const Vec b = absolute(hull.vertices[hull.head[e]] - anchor);
            size += a.y * b.z + a.z * b.y + a.z * b.x + a.x * b.z + a.x * b.y + a.y * b.x;
        }
        return rounding * size * static_cast<double>(1 + end - start) / (2.0 * hull.areas[f]);
    }

    Vec center_;
    Errors normal_errors_;  // of doubles
};

}  // namespace dicedesign
