// The box around points that may not be numbers, and their scale.
#pragma once

#include <cmath>

#include "vector.hpp"

namespace dicedesign {

// The box around points, of which there is at least one, and whether all of them are finite.
struct Bounds : Box {
    Bounds(const Vec* points, std::size_t count) : Box(points[0]) {
        double total = 0.0;
        for (std::size_t i = 0; i < count; ++i) {
            const Vec& p = points[i];
            add(p);
            total += 0.0 * p.x + 0.0 * p.y + 0.0 * p.z;
        }
        // Zero times what is missing or infinite is not zero.
        finite = total == 0.0;
    }

    bool finite;
};

// Multiplies by a power of two in two steps, as the power itself may be no double.
class PowerOfTwo {
public:
    explicit PowerOfTwo(int exponent)
        : first_(std::ldexp(1.0, exponent / 2)),
          second_(std::ldexp(1.0, exponent - exponent / 2)) {}

    double operator()(double x) const { return x * first_ * second_; }
    Vec operator()(const Vec& a) const { return {(*this)(a.x), (*this)(a.y), (*this)(a.z)}; }

private:
    double first_, second_;
};

}  // namespace dicedesign
