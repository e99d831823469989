// The box around points that may not be numbers.
#pragma once

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

}  // namespace dicedesign
