// Vectors of three numbers of any kind: double, or numbers of more digits.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace dicedesign {

using Index = std::int64_t;

template <class Real>
struct Vector {
    Real x, y, z;
};

using Vec = Vector<double>;

inline constexpr double PI = 3.14159265358979323846;

template <class Real>
inline Vector<Real> operator+(const Vector<Real>& a, const Vector<Real>& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}

template <class Real>
inline Vector<Real> operator-(const Vector<Real>& a, const Vector<Real>& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}

template <class Real>
inline Vector<Real> operator-(const Vector<Real>& a) {
    return {-a.x, -a.y, -a.z};
}

template <class Real>
inline Vector<Real> operator*(const Real& s, const Vector<Real>& a) {
    return {s * a.x, s * a.y, s * a.z};
}

template <class Real>
inline Real dot(const Vector<Real>& a, const Vector<Real>& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class Real>
inline Vector<Real> cross(const Vector<Real>& a, const Vector<Real>& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Direction of `u` moved parallel to `along` until it is perpendicular to `normal`, times
// `along . normal`.
template <class Real>
inline Vector<Real> oblique_projection(const Vector<Real>& u, const Vector<Real>& along,
                                       const Vector<Real>& normal) {
    return dot(along, normal) * u - dot(u, normal) * along;
}

inline Vec& operator+=(Vec& a, const Vec& b) { return a = a + b; }

inline double norm(const Vec& a) { return std::sqrt(dot(a, a)); }

inline Vec absolute(const Vec& a) { return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)}; }

// Of numbers none of which is NaN: `std::fmax`, which minds it, is a call.
inline double larger(double a, double b) { return a > b ? a : b; }

inline double smaller(double a, double b) { return a < b ? a : b; }

inline double largest(const Vec& a) { return larger(larger(a.x, a.y), a.z); }

inline double sum(const Vec& a) { return a.x + a.y + a.z; }

// Gradient in a vector of some length for that in the unit vector along it.
inline Vec before_scaling(const Vec& gradient, const Vec& unit, double length) {
    return (1.0 / length) * (gradient - dot(unit, gradient) * unit);
}

// The smallest box along the axes around points, of which there is at least one.
struct Box {
    explicit Box(const Vec& point) : lower(point), upper(point) {}

    void add(const Vec& p) {
        lower = {smaller(lower.x, p.x), smaller(lower.y, p.y), smaller(lower.z, p.z)};
        upper = {larger(upper.x, p.x), larger(upper.y, p.y), larger(upper.z, p.z)};
    }

    double extent() const { return largest(upper - lower); }

    // Largest difference of a coordinate from the coordinate of a point inside.
    double reach(const Vec& middle) const {
        return larger(largest(upper - middle), largest(middle - lower));
    }

    // Largest coordinate.
    double magnitude() const { return larger(largest(upper), largest(-lower)); }

    Vec lower, upper;
};

}  // namespace dicedesign
