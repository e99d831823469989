// The probabilities of a thrown body from its features in the momentum model: the formulas of
// dicedesign/throws/momentum_probabilities.py, with numbers of any kind.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "throws/transition_features.hpp"

namespace dicedesign {

// exp(a), smoothly kept below 1 / least, of a sum a of numbers with weights.
template <std::size_t COUNT>
double bounded(const std::array<double, COUNT>& weights, const std::array<double, COUNT>& numbers,
               double least) {
    double sum = 0.0;
    for (std::size_t i = 0; i < COUNT; ++i) sum += weights[i] * numbers[i];
    return 1.0 / (std::exp(-sum) + least);
}

template <std::size_t COUNT>
Traced bounded(const std::array<double, COUNT>& weights, const std::array<Traced, COUNT>& numbers,
               double least) {
    std::array<double, COUNT> values, slopes;
    for (std::size_t i = 0; i < COUNT; ++i) values[i] = numbers[i].value;
    const double rate = bounded(weights, values, least);
    const double rise = rate * (1.0 - rate * least);
    for (std::size_t i = 0; i < COUNT; ++i) slopes[i] = rise * weights[i];
    return made(rate, slopes.data(), 1, numbers.data(), COUNT);
}

// Outputs of a network; its hidden units are left in `hidden`.
template <std::size_t OUTPUTS, std::size_t FEATURES>
std::array<double, OUTPUTS> outputs(const MomentumNetwork& network,
                                    const std::array<double, FEATURES>& features,
                                    std::vector<double>& hidden) {
    hidden.assign(network.shift, network.shift + network.hidden);
    std::array<double, OUTPUTS> found;
    std::copy_n(network.bias, OUTPUTS, found.begin());
    for (std::size_t i = 0; i < FEATURES; ++i) {
        const double* inward = network.inward + network.hidden * i;
        const double* linear = network.linear + OUTPUTS * i;
        for (std::size_t j = 0; j < hidden.size(); ++j) hidden[j] += features[i] * inward[j];
        for (std::size_t j = 0; j < OUTPUTS; ++j) found[j] += features[i] * linear[j];
    }
    for (std::size_t i = 0; i < hidden.size(); ++i) {
        hidden[i] = std::tanh(hidden[i]);
        const double* outward = network.outward + OUTPUTS * i;
        for (std::size_t j = 0; j < OUTPUTS; ++j) found[j] += hidden[i] * outward[j];
    }
    return found;
}

// The same; an output is written down as made of the features alone.
template <std::size_t OUTPUTS, std::size_t FEATURES>
std::array<Traced, OUTPUTS> outputs(const MomentumNetwork& network,
                                    const std::array<Traced, FEATURES>& features,
                                    std::vector<double>& hidden) {
    std::array<double, FEATURES> values;
    for (std::size_t i = 0; i < FEATURES; ++i) values[i] = features[i].value;
    const auto plain = outputs<OUTPUTS>(network, values, hidden);
    std::array<double, OUTPUTS * FEATURES> slopes;
    std::copy_n(network.linear, slopes.size(), slopes.begin());
    for (std::size_t j = 0; j < hidden.size(); ++j) {
        const double rise = 1.0 - hidden[j] * hidden[j];
        const double* outward = network.outward + OUTPUTS * j;
        for (std::size_t i = 0; i < FEATURES; ++i) {
            const double inward = rise * network.inward[network.hidden * i + j];
            double* const row = slopes.data() + OUTPUTS * i;
            for (std::size_t k = 0; k < OUTPUTS; ++k) row[k] += inward * outward[k];
        }
    }
    std::array<Traced, OUTPUTS> found;
    for (std::size_t k = 0; k < OUTPUTS; ++k) {
        found[k] = made(plain[k], slopes.data() + k, OUTPUTS, features.data(), FEATURES);
    }
    return found;
}

// The rates of passes and the weights of carries at each impact.
template <class Real>
struct Rates {
    Rates(const ThrownBody<Real>& body, const Ways& ways, const Momentum& model) {
        using std::exp, std::expm1, std::log, std::tanh;
        const double most_stretch = model.constants.most_stretch;
        const double rounding = model.constants.rounding;
        std::vector<double> hidden;
        for (std::size_t p = 0; p < ways.source.size(); ++p) {
            const auto pass = static_cast<Index>(p);
            const auto going =
                outputs<PASS_OUTPUTS>(model.passes, body.pass_features(ways, pass), hidden);
            const Real barrier = body.before(pass).barrier;
            const Real stretch =
                exp(Real(most_stretch) * tanh(Real(1.0 / most_stretch) * going[3]));
            // One of no height may come out below 0 by rounding.
            const Real height = value_of(barrier) > rounding ? barrier : Real(rounding);
            const Real free = -log(-expm1(Real(-1.0 / model.constants.no_barrier) * height));
            passes.push_back({going[0], going[1], going[2], stretch * barrier, free});
        }
        for (std::size_t carry = 0; carry < ways.first.size(); ++carry) {
            const auto going =
                outputs<CARRY_OUTPUTS>(model.carries, body.carry_features(ways, carry), hidden);
            const Real exit = body.before(ways.second[carry]).barrier;
            carries.push_back({going[0], going[1], going[2], exit});
        }
    }

    std::vector<std::array<Real, 5>> passes;
    std::vector<std::array<Real, 4>> carries;
};

// One impact: the probabilities (k) afterwards take the place of those before.
template <class Real>
class Impact {
public:
    Impact(const Ways& ways, std::size_t rests, std::size_t most_carries)
        : ways_(ways), most_carries_(most_carries), leaving_(rests), gone_(rests), flow_(ways.source.size()),
          stays_(ways.source.size()), coming_(ways.source.size()) {}

    void operator()(const std::vector<Real>& rate, const std::vector<Real>& weight,
                    std::vector<Real>& probabilities) {
        leave(rate, probabilities);
        for (Real& stays : stays_) stays = Real(1.0);
        for (std::size_t i = 0; i < weight.size(); ++i) stays_[first(i)] += weight[i];
        for (Real& stays : stays_) stays = Real(1.0) / stays;
        std::vector<Real> carried(weight.size());
        for (std::size_t i = 0; i < weight.size(); ++i) carried[i] = weight[i] * stays_[first(i)];
        for (std::size_t times = 0; times < most_carries_; ++times) {
            for (std::size_t p = 0; p < flow_.size(); ++p) {
                add_product(probabilities[target(p)], flow_[p], stays_[p]);
                coming_[p] = Real(0.0);
            }
            for (std::size_t i = 0; i < weight.size(); ++i) {
                add_product(coming_[second(i)], flow_[first(i)], carried[i]);
            }
            flow_.swap(coming_);
        }
        for (std::size_t p = 0; p < flow_.size(); ++p) probabilities[target(p)] += flow_[p];
    }

private:
    std::size_t first(std::size_t carry) const {
        return static_cast<std::size_t>(ways_.first[carry]);
    }

    std::size_t second(std::size_t carry) const {
        return static_cast<std::size_t>(ways_.second[carry]);
    }

    std::size_t source(std::size_t pass) const {
        return static_cast<std::size_t>(ways_.source[pass]);
    }

    std::size_t target(std::size_t pass) const {
        return static_cast<std::size_t>(ways_.target[pass]);
    }

    void leave(const std::vector<Real>& rate, std::vector<Real>& probabilities) {
        using std::expm1;
        for (Real& leaving : leaving_) leaving = Real(0.0);
        for (std::size_t p = 0; p < rate.size(); ++p) leaving_[source(p)] += rate[p];
        for (std::size_t i = 0; i < probabilities.size(); ++i) {
            // A rest that nothing leads away from is never left.
            if (!(value_of(leaving_[i]) > 0.0)) {
                gone_[i] = Real(0.0);
                continue;
            }
            gone_[i] = probabilities[i] * (-expm1(-leaving_[i])) / leaving_[i];
            probabilities[i] -= gone_[i] * leaving_[i];
        }
        for (std::size_t p = 0; p < rate.size(); ++p) flow_[p] = gone_[source(p)] * rate[p];
    }

    const Ways& ways_;
    std::size_t most_carries_;
    std::vector<Real> leaving_, gone_;         // (k)
    std::vector<Real> flow_, stays_, coming_;  // (m)
};

// Probabilities (k) of the rests for those without momentum.
template <class Real>
std::vector<Real> landing_probabilities(const Landing& landing, const Momentum& model,
                               const std::vector<Vector<Real>>& vertices,
                               const Vector<Real>& center, const Symmetric<Real>& inertia,
                               std::vector<Real> probabilities) {
    if (landing.paths.saddles == 0) return probabilities;
    const MomentumConstants& constants = model.constants;
    const Ways ways(landing);
    const ThrownBody<Real> body(landing, vertices, center, inertia, probabilities, constants);
    const Rates<Real> rates(body, ways, model);
    std::vector<Real> rate(ways.source.size()), weight(ways.first.size());
    Impact<Real> impact(ways, probabilities.size(), constants.carries);
    const double least = std::exp(-constants.most_rate);
    const double impacts = static_cast<double>(constants.impacts);
    for (std::size_t i = 0; i < constants.impacts; ++i) {
        const double time = 0.5 - (static_cast<double>(i) + 0.5) / impacts;
        const double cold = std::exp(-model.hot - model.cooling * (time - 0.5));
        const double square = time * time - 0.08;
        const std::array<double, 5> passing{1.0, time, square, -cold, 1.0};
        const std::array<double, 4> carrying{1.0, time, square, -cold * model.carry_barrier};
        for (std::size_t p = 0; p < rate.size(); ++p) {
            rate[p] = bounded(passing, rates.passes[p], least);
        }
        for (std::size_t j = 0; j < weight.size(); ++j) {
            weight[j] = bounded(carrying, rates.carries[j], least);
        }
        impact(rate, weight, probabilities);
    }
    return probabilities;
}

}  // namespace dicedesign
