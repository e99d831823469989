// Which vertices can touch the table, of a body that moves a little at a time.
#pragma once

#include <limits>
#include <vector>

#include "throws/landing.hpp"

namespace dicedesign {

// Height below which a vertex is near the table, relative to the body's radius. Less leaves fewer
// vertices to look at in a step, and all of them more often. It changes no result.
inline constexpr double SKIN = 0.05;

// Far more than the rounding of such a height and of larger ones, relative to them.
inline constexpr double HEIGHT_ROUNDING = 1e-9;

// The table's list of neighbors (Verlet, Physical Review 159, 1967). Since all vertices were
// looked at, none has come lower by more than the body fell plus the radius times how far the unit
// vector `up` moved. Until that is as far as those not in the list were above the table, they are
// above it.
class NearTable {
public:
    explicit NearTable(const Landscape& landscape) : land(landscape) {
        for (Index v = 0; v < land.vertices; ++v) radius = larger(radius, norm(land.vertex[v]));
    }

    // Largest distance of a vertex from the center of mass.
    double reach() const { return radius; }

    // Vertices in ascending order, with all that are below the table among them, if the center of
    // mass is at `height` and `up` is that direction in the body's axes.
    const std::vector<Index>& at(const Vec& up, double height) {
        const Vec moved = up - seen_up;
        const double left = height - least_height;
        // Also where a number is not finite.
        if (!(left > 0.0 && radius * radius * dot(moved, moved) < left * left)) look(up, height);
        return near;
    }

private:
    void look(const Vec& up, double height) {
        const double skin = SKIN * radius;
        double lowest = std::numeric_limits<double>::infinity();
        near.clear();
        for (Index v = 0; v < land.vertices; ++v) {
            const double z = height + dot(up, land.vertex[v]);
            if (z < skin) near.push_back(v);
            lowest = smaller(lowest, z);
        }
        seen_up = up;
        least_height = height - (1.0 - HEIGHT_ROUNDING) * larger(skin, lowest);
    }

    const Landscape& land;
    double radius = 0.0;
    std::vector<Index> near;
    Vec seen_up{0.0, 0.0, 0.0};
    // Of the center of mass, for the list to hold if `up` stays.
    double least_height = std::numeric_limits<double>::infinity();
};

}  // namespace dicedesign
