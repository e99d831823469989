// Numbers of about 106 binary digits: the unevaluated sum of two doubles.
//
// Source: T. J. Dekker, "A floating-point technique for extending the available precision", Numer.
// Math. 18, 1971; D. E. Knuth, The Art of Computer Programming 2, section 4.2.2.
#pragma once

namespace dicedesign {

struct Twofold {
    double high, low;

    Twofold() = default;
    Twofold(double value) : high(value), low(0.0) {}
    Twofold(double high, double low) : high(high), low(low) {}
};

// a + b without error.
inline Twofold exact_sum(double a, double b) {
    const double s = a + b;
    const double t = s - a;
    return {s, (a - (s - t)) + (b - t)};
}

// The same for numbers of which the first is not the smaller one, or zero.
inline Twofold exact_sum_of_ordered(double a, double b) {
    const double s = a + b;
    return {s, b - (s - a)};
}

// The upper half of a number's digits.
inline double upper_half(double a) {
    const double t = 134217729.0 * a;
    return t - (t - a);
}

// a b without error.
inline Twofold exact_product(double a, double b) {
    const double p = a * b;
    const double ah = upper_half(a), bh = upper_half(b);
    const double al = a - ah, bl = b - bh;
    return {p, ((ah * bh - p) + ah * bl + al * bh) + al * bl};
}

inline Twofold operator-(Twofold a) { return {-a.high, -a.low}; }

inline Twofold operator+(Twofold a, Twofold b) {
    Twofold s = exact_sum(a.high, b.high);
    const Twofold t = exact_sum(a.low, b.low);
    s = exact_sum_of_ordered(s.high, s.low + t.high);
    return exact_sum_of_ordered(s.high, s.low + t.low);
}

inline Twofold operator-(Twofold a, Twofold b) { return a + -b; }

inline Twofold operator*(Twofold a, Twofold b) {
    Twofold p = exact_product(a.high, b.high);
    p.low += a.high * b.low + a.low * b.high;
    return exact_sum_of_ordered(p.high, p.low);
}

}  // namespace dicedesign
