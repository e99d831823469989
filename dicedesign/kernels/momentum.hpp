// Odds of a thrown body by the momentum model, and their derivatives.
#pragma once

#include <array>
#include <vector>

#include "facets.hpp"
#include "vector.hpp"

namespace dicedesign {

inline constexpr std::size_t PASS_FEATURES = 29, PASS_OUTPUTS = 4;
inline constexpr std::size_t CARRY_FEATURES = 14, CARRY_OUTPUTS = 3;

// The six different entries of a symmetric matrix: xx, yy, zz, xy, yz, zx.
template <class Real>
using Symmetric = std::array<Real, 6>;

// The rests of a hull (facets) and the saddles that divide their basins, as `Separatrices`.
struct Landing {
    Polygons facets;
    Index vertices, rests;
    const Index* resting;
    Index saddles;
    const Index *basins, *saddle_ends;
};

// As `Network`: a linear map plus a hidden layer, here for features that are not scaled.
struct MomentumNetwork {
    const double *linear, *bias, *inward, *shift, *outward;
    std::size_t hidden;
};

// As `MomentumModel`.
struct Momentum {
    double hot, cooling, carry_barrier;
    MomentumNetwork passes, carries;
};

// Odds (k) of the rests of a body with corners, a center of mass, a tensor of inertia over the mass
// and odds (k) without momentum.
std::vector<double> thrown_odds(const Landing& landing, const Momentum& model, const Vec* corners,
                                const Vec& center, const Symmetric<double>& inertia,
                                const double* odds);

// Tensor of inertia of the uniform solid over its mass, about its own center of mass.
Symmetric<double> solid_inertia(const Polygons& facets, const Vec* corners, Index count);

// Add gradients of weighted sums (r, k) of the odds of a body with the inertia of a uniform solid:
// those in the corners (r, n), with which the inertia changes, in the center (r) and in the odds
// without momentum (r, k).
void pull_back_thrown_odds(const Landing& landing, const Momentum& model, const Vec* corners,
                           const Vec& center, const double* odds, const double* weights,
                           std::size_t count, double* by_corners, double* by_center,
                           double* by_odds);

}  // namespace dicedesign
