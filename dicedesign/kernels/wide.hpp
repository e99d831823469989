// Numbers of N 32-bit limbs with an exponent, for decisions that twofold numbers leave open.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace dicedesign {

// sign * (sum of limb[i] * 2^(32 (exponent - 1 - i))). The first limb of a number is not 0, unless
// all are. Sums and products are truncated: their errors are below 2^-(32 (N - 1)) of the larger
// operand, or of the product.
template <int N>
struct Wide {
    int sign = 0, exponent = 0;
    std::array<std::uint32_t, N> limb{};

    Wide() = default;

    // Exact.
    Wide(double value) {
        if (value == 0.0) return;
        sign = value < 0.0 ? -1 : 1;
        std::frexp(value, &exponent);
        exponent = (exponent + 32 * 64 + 31) / 32 - 64;  // rounded up
        double rest = std::ldexp(std::fabs(value), -32 * exponent);
        for (int i = 0; i < 3; ++i) {
            rest *= 0x1p32;
            limb[i] = static_cast<std::uint32_t>(rest);
            rest -= limb[i];
        }
    }

    // From limbs, of which the leading ones may be 0.
    template <std::size_t M>
    Wide(int sign, int exponent, const std::array<std::uint32_t, M>& limbs) {
        std::size_t first = 0;
        while (first < M && limbs[first] == 0) ++first;
        if (first == M) return;
        this->sign = sign;
        this->exponent = exponent - static_cast<int>(first);
        for (int i = 0; i < N && first + i < M; ++i) limb[i] = limbs[first + i];
    }

    // The last limb that is not 0, of a number that is not 0.
    int last() const {
        int place = N - 1;
        while (limb[place] == 0) --place;
        return place;
    }
};

template <int N>
double rounded(const Wide<N>& a) {
    double value = 0.0;
    for (int i = 2; i >= 0; --i) value = value * 0x1p-32 + a.limb[i];
    return a.sign * std::ldexp(value, 32 * (a.exponent - 1));
}

template <int N>
Wide<N> operator-(Wide<N> a) {
    a.sign = -a.sign;
    return a;
}

template <int N>
Wide<N> operator+(const Wide<N>& a, const Wide<N>& b) {
    if (a.sign == 0) return b;
    if (b.sign == 0) return a;
    if (a.exponent < b.exponent) return b + a;
    const int shift = a.exponent - b.exponent;
    // One limb before for a carry, one behind for digits that count once leading ones cancel.
    std::array<std::int64_t, N + 2> sums{};
    for (int i = 0; i < N; ++i) sums[i + 1] = a.sign * std::int64_t{a.limb[i]};
    for (int i = 0; i < N && i + 1 + shift < N + 2; ++i) {
        sums[i + 1 + shift] += b.sign * std::int64_t{b.limb[i]};
    }
    // What follows the first limb that is not 0 is less than one unit of it.
    int sign = 0;
    for (int i = 0; i < N + 2 && sign == 0; ++i) sign = (sums[i] > 0) - (sums[i] < 0);
    std::array<std::uint32_t, N + 2> limbs;
    std::int64_t carry = 0;
    for (int i = N + 1; i >= 0; --i) {
        const std::int64_t value = sign * sums[i] + carry;
        limbs[i] = static_cast<std::uint32_t>(value & 0xffffffff);
        carry = (value - limbs[i]) / 0x100000000;
    }
    return {sign, a.exponent + 1, limbs};
}

template <int N>
Wide<N> operator-(const Wide<N>& a, const Wide<N>& b) {
    return a + -b;
}

template <int N>
Wide<N> operator*(const Wide<N>& a, const Wide<N>& b) {
    if (a.sign == 0 || b.sign == 0) return {};
    // Coordinates and their differences end in many limbs of 0.
    const int last_of_a = a.last(), last_of_b = b.last();
    std::array<std::uint32_t, 2 * N> limbs{};
    for (int i = last_of_a; i >= 0; --i) {
        std::uint64_t carry = 0;
        for (int j = last_of_b; j >= 0; --j) {
            const std::uint64_t value =
                std::uint64_t{a.limb[i]} * b.limb[j] + limbs[i + j + 1] + carry;
            limbs[i + j + 1] = static_cast<std::uint32_t>(value);
            carry = value >> 32;
        }
        limbs[i] = static_cast<std::uint32_t>(carry);
    }
    return {a.sign * b.sign, a.exponent + b.exponent, limbs};
}

}  // namespace dicedesign
