// Derivatives in reverse: numbers that write down how they were made.
//
// Source: A. Griewank, A. Walther, Evaluating Derivatives, 2nd edition, SIAM 2008, section 3.2.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "vector.hpp"

namespace dicedesign {

// Numbers computed from others, in order, each with its partial derivatives in its operands.
class Tape {
public:
    using Place = std::int32_t;

    // Number of gradients propagated at once.
    static constexpr std::size_t WIDTH = 8;

    // The next number to be written depends on the one at a place.
    void depends(Place place, double partial) { partials_.push_back({place, partial}); }

    // Append a number.
    Place write() {
        ends_.push_back(partials_.size());
        return static_cast<Place>(ends_.size() - 1);
    }

    std::size_t size() const { return ends_.size(); }

    // Propagate gradients (size, WIDTH) in the numbers back to their operands.
    void sweep(std::vector<double>& gradients) const {
        for (std::size_t place = ends_.size(); place-- > 0;) {
            const double* from = gradients.data() + WIDTH * place;
            const std::size_t begin = place == 0 ? 0 : ends_[place - 1];
            for (std::size_t i = begin; i < ends_[place]; ++i) {
                const Partial& partial = partials_[i];
                double* to = gradients.data() + WIDTH * static_cast<std::size_t>(partial.of);
                for (std::size_t j = 0; j < WIDTH; ++j) to[j] += partial.slope * from[j];
            }
        }
    }

private:
    struct Partial {
        Place of;
        double slope;
    };

    std::vector<std::size_t> ends_;
    std::vector<Partial> partials_;
};

// A number with its place on a tape; one without a tape is a constant.
struct Traced {
    Traced() = default;
    Traced(double value) : value(value) {}
    Traced(double value, Tape* tape) : value(value), tape(tape), place(tape->write()) {}

    double value = 0.0;
    Tape* tape = nullptr;
    Tape::Place place = 0;
};

inline double value_of(double a) { return a; }
inline double value_of(const Traced& a) { return a.value; }

inline void depends(Tape& tape, const Traced& a, double slope) {
    if (a.tape != nullptr) tape.depends(a.place, slope);
}

// A number made of one or two others, with the partial derivatives in them.
inline Traced made(double value, const Traced& a, double by_a) {
    if (a.tape == nullptr) return value;
    a.tape->depends(a.place, by_a);
    return {value, a.tape};
}

inline Traced made(double value, const Traced& a, double by_a, const Traced& b, double by_b) {
    Tape* const tape = a.tape != nullptr ? a.tape : b.tape;
    if (tape == nullptr) return value;
    depends(*tape, a, by_a);
    depends(*tape, b, by_b);
    return {value, tape};
}

// One made of some others (n), at least one of which is on a tape; the partial derivatives are
// `stride` apart.
inline Traced made(double value, const double* slopes, std::size_t stride, const Traced* numbers,
                   std::size_t count) {
    Tape* tape = nullptr;
    for (std::size_t i = 0; i < count; ++i) {
        if (numbers[i].tape == nullptr) continue;
        tape = numbers[i].tape;
        tape->depends(numbers[i].place, slopes[stride * i]);
    }
    return {value, tape};
}

inline Traced operator-(const Traced& a) { return made(-a.value, a, -1.0); }

inline Traced operator+(const Traced& a, const Traced& b) {
    return made(a.value + b.value, a, 1.0, b, 1.0);
}

inline Traced operator-(const Traced& a, const Traced& b) {
    return made(a.value - b.value, a, 1.0, b, -1.0);
}

inline Traced operator*(const Traced& a, const Traced& b) {
    return made(a.value * b.value, a, b.value, b, a.value);
}

inline Traced operator/(const Traced& a, const Traced& b) {
    const double quotient = a.value / b.value;
    return made(quotient, a, 1.0 / b.value, b, -quotient / b.value);
}

inline Traced& operator+=(Traced& a, const Traced& b) { return a = a + b; }
inline Traced& operator-=(Traced& a, const Traced& b) { return a = a - b; }

// At 0, where a length has no derivative, that is taken as 0.
inline Traced sqrt(const Traced& a) {
    const double root = std::sqrt(a.value);
    return made(root, a, root > 0.0 ? 0.5 / root : 0.0);
}

inline Traced exp(const Traced& a) {
    const double power = std::exp(a.value);
    return made(power, a, power);
}

inline Traced expm1(const Traced& a) {
    return made(std::expm1(a.value), a, std::exp(a.value));
}

inline Traced log(const Traced& a) { return made(std::log(a.value), a, 1.0 / a.value); }

inline Traced tanh(const Traced& a) {
    const double value = std::tanh(a.value);
    return made(value, a, 1.0 - value * value);
}

inline Traced atan2(const Traced& y, const Traced& x) {
    const double square = y.value * y.value + x.value * x.value;
    return made(std::atan2(y.value, x.value), y, x.value / square, x, -y.value / square);
}

// Sums of products are written down as one number each.

inline Traced dot(const Vector<Traced>& a, const Vector<Traced>& b) {
    Tape* const tape = a.x.tape != nullptr ? a.x.tape : b.x.tape;
    const double value = a.x.value * b.x.value + a.y.value * b.y.value + a.z.value * b.z.value;
    if (tape == nullptr) return value;
    depends(*tape, a.x, b.x.value);
    depends(*tape, a.y, b.y.value);
    depends(*tape, a.z, b.z.value);
    depends(*tape, b.x, a.x.value);
    depends(*tape, b.y, a.y.value);
    depends(*tape, b.z, a.z.value);
    return {value, tape};
}

// sum += a * b
inline void add_product(double& sum, double a, double b) { sum += a * b; }

inline void add_product(Traced& sum, const Traced& a, const Traced& b) {
    Tape* const tape = a.tape != nullptr ? a.tape : b.tape;
    if (tape == nullptr) {
        sum += Traced(a.value * b.value);
        return;
    }
    const double value = sum.value + a.value * b.value;
    depends(*tape, sum, 1.0);
    depends(*tape, a, b.value);
    depends(*tape, b, a.value);
    sum = {value, tape};
}

}  // namespace dicedesign
