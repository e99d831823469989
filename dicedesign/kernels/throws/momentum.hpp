// Probabilities of a thrown body by the momentum model, and their derivatives.
#pragma once

#include <array>
#include <vector>

#include "hull/hull.hpp"
#include "rest/areas.hpp"

namespace dicedesign {

inline constexpr std::size_t PASS_FEATURES = 29, PASS_OUTPUTS = 4;
inline constexpr std::size_t CARRY_FEATURES = 14, CARRY_OUTPUTS = 3;

// The six different entries of a symmetric matrix: xx, yy, zz, xy, yz, zx.
template <class Real>
using Symmetric = std::array<Real, 6>;

// A hull with its rests and the saddles that divide their basins.
struct Landing {
    const Hull& hull;
    const Paths& paths;
};

// As `Network`: a linear map plus a hidden layer, here for features that are not scaled.
struct MomentumNetwork {
    const double *linear, *bias, *inward, *shift, *outward;
    std::size_t hidden;
};

// Constants of dicedesign/throws/momentum, under their names.
struct MomentumConstants {
    // Of momentum_probabilities.py.
    std::size_t impacts, carries;
    double most_rate, most_stretch, no_barrier;
    // Of transition_features.py.
    double log_softening, speed_softening, energy_softening, most_lacking, sharpness;
    // Of tolerances.py.
    double rounding;
};

// As `MomentumModel`.
struct Momentum {
    double hot, cooling, carry_barrier;
    MomentumNetwork passes, carries;
    MomentumConstants constants;
};

// Probabilities (k) of the rests of a body with a center of mass, a tensor of inertia over the mass and probabilities
// (k) without momentum.
std::vector<double> throw_probabilities(const Landing& landing, const Momentum& model, const Vec& center,
                                const Symmetric<double>& inertia, const double* probabilities);

// Tensor of inertia of the uniform solid over its mass, about its own center of mass.
Symmetric<double> solid_inertia(const Hull& hull);

// Add gradients of weighted sums (r, k) of the probabilities of a body with the inertia of a uniform solid:
// those in the corners (r, n), with which the inertia changes, in the center (r) and in the probabilities
// without momentum (r, k).
void pull_back_throw_probabilities(const Landing& landing, const Momentum& model, const Vec& center,
                           const double* probabilities, const double* weights, std::size_t count,
                           double* by_corners, double* by_center, double* by_probabilities);

}  // namespace dicedesign
