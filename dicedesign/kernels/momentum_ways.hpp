// Ways from rest to rest as integers, see `Passes` in dicedesign/throws/momentum/transitions.py.
#pragma once

#include <vector>

#include "momentum.hpp"

namespace dicedesign {

// Pass p goes over saddle p % s, from the basin on its side p / s to that on the other.
struct Ways {
    explicit Ways(const Landing& landing) {
        const auto saddles = static_cast<std::size_t>(landing.saddles);
        std::vector<std::vector<Index>> leaving(static_cast<std::size_t>(landing.rests));
        for (std::size_t pass = 0; pass < 2 * saddles; ++pass) {
            const Index* basins = landing.basins + 2 * (pass % saddles);
            source.push_back(basins[pass / saddles]);
            target.push_back(basins[1 - pass / saddles]);
            leaving[static_cast<std::size_t>(source.back())].push_back(static_cast<Index>(pass));
        }
        for (std::size_t pass = 0; pass < 2 * saddles; ++pass) {
            for (const Index next : leaving[static_cast<std::size_t>(target[pass])]) {
                if (static_cast<std::size_t>(next) % saddles == pass % saddles) continue;
                first.push_back(static_cast<Index>(pass));
                second.push_back(next);
            }
        }
    }

    std::vector<Index> source, target;  // (m)
    std::vector<Index> first, second;   // (t)
};

}  // namespace dicedesign
