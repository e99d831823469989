// On which side of a plane through three points a fourth lies, to the last bit.
#pragma once

#include "twofold.hpp"
#include "vector.hpp"

namespace dicedesign {

// A sum of doubles without rounding, as parts that do not overlap, the largest last.
// Source: Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
// Predicates", Discrete Comput. Geom. 18, 1997.
class ExactSum {
public:
    void add(double term) {
        int kept = 0;
        for (int i = 0; i < size_; ++i) {
            const Twofold total = exact_sum(term, part_[i]);
            if (total.low != 0.0) part_[kept++] = total.low;
            term = total.high;
        }
        if (term != 0.0) part_[kept++] = term;
        size_ = kept;
    }

    void add_product(const Twofold& a, const Twofold& b, const Twofold& c) {
        for (const double i : {a.high, a.low})
            for (const double j : {b.high, b.low})
                for (const double k : {c.high, c.low})
                    if (i != 0.0 && j != 0.0 && k != 0.0) add_product(i, j, k);
    }

    int sign() const { return size_ == 0 ? 0 : (part_[size_ - 1] > 0.0 ? 1 : -1); }

private:
    void add_product(double a, double b, double c) {
        const Twofold first = exact_product(a, b);
        add_product(first.high, c);
        if (first.low != 0.0) add_product(first.low, c);
    }

    void add_product(double a, double b) {
        const Twofold product = exact_product(a, b);
        add(product.high);
        add(product.low);
    }

    double part_[192];  // each of six products of three pairs brings eight times four
    int size_ = 0;
};

// 1 where q is above the triangle a, b, c, which turns counter-clockwise seen from above, -1 where
// it is below, 0 where all four are on one plane. Coordinates are at most 1, and no product of
// three differences may lose digits to underflow.
inline int exact_side(const Vec& a, const Vec& b, const Vec& c, const Vec& q) {
    const Vec u = b - a, v = c - a, w = q - a;
    const Vec normal = cross(u, v);
    const Vec size{std::fabs(u.y * v.z) + std::fabs(u.z * v.y),
                   std::fabs(u.z * v.x) + std::fabs(u.x * v.z),
                   std::fabs(u.x * v.y) + std::fabs(u.y * v.x)};
    // At most eight roundings of 2^-53 on the way of each of the six products, and a margin.
    const double value = dot(normal, w), bound = 0x1p-49 * dot(size, absolute(w));
    if (value > bound) return 1;
    if (value < -bound) return -1;
    if (bound == 0.0) return 0;
    // The same with twice the digits, where roundings are below 2^-102.
    const auto difference = [](const Vec& p, const Vec& r) {
        return Vector<Twofold>{exact_sum(p.x, -r.x), exact_sum(p.y, -r.y), exact_sum(p.z, -r.z)};
    };
    const Vector<Twofold> i = difference(b, a), j = difference(c, a), k = difference(q, a);
    const double better = dot(cross(i, j), k).high;
    if (std::fabs(better) > 0x1p-48 * bound) return better > 0.0 ? 1 : -1;
    ExactSum sum;
    sum.add_product(i.y, j.z, k.x);
    sum.add_product(-i.z, j.y, k.x);
    sum.add_product(i.z, j.x, k.y);
    sum.add_product(-i.x, j.z, k.y);
    sum.add_product(i.x, j.y, k.z);
    sum.add_product(-i.y, j.x, k.z);
    return sum.sign();
}

}  // namespace dicedesign
