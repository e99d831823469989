// Vectors of three numbers of any kind: double, or the pairs of doubles of `twofold.hpp`.
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

inline double norm(const Vec& a) { return std::sqrt(dot(a, a)); }

inline Vec absolute(const Vec& a) { return {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)}; }

// Of numbers: `std::fmax`, which minds NaN, is a call.
inline double larger(double a, double b) { return a > b ? a : b; }

inline double smaller(double a, double b) { return a < b ? a : b; }

inline double largest(const Vec& a) { return larger(larger(a.x, a.y), a.z); }

inline double sum(const Vec& a) { return a.x + a.y + a.z; }

}  // namespace dicedesign
