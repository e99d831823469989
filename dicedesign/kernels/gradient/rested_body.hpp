// Probabilities and normals of a body's rests from its points alone, and their derivatives.
#pragma once

#include <optional>
#include <vector>

#include "hull/made_hull.hpp"
#include "rest/areas.hpp"
#include "rest/morse.hpp"

namespace dicedesign {

// Tolerances of dicedesign/tolerances.py.
struct RestTolerances {
    double coplanar, precision;
    MeasureTolerances measures;
    double boundary, tie, near_antipode, closure;
};

// A body about which rounding can change nothing, with its rests, the most probable first.
class RestedBody {
public:
    // The convex hull of points with a center of mass, or of the uniform solid without one; nothing
    // where rounding leaves anything open, or where there is no such body.
    static std::optional<RestedBody> of(const Vec* points, std::size_t count, const Vec* center,
                                        const RestTolerances& tolerances);

    // (k) by rest.
    std::vector<Index> facets;
    std::vector<Vec> normals;
    std::vector<double> probabilities;

    // Add the gradient of the weighted sum of normals (k) and probabilities (k) to that in the points and in
    // a center that was given; false where derivatives are left open. Points inside the hull have
    // none.
    bool pull_back(const Vec* by_normals, const double* by_probabilities, Vec* by_points,
                   Vec& by_center) const;

private:
    RestedBody(MadeHull&& hull, Separatrices&& paths, const Vec& center, bool uniform,
               double thin_volume)
        : hull_(std::move(hull)), paths_(std::move(paths)), center_(center), uniform_(uniform),
          thin_volume_(thin_volume) {}

    Paths paths() const;

    MadeHull hull_;
    Separatrices paths_;
    Vec center_;
    bool uniform_;
    double thin_volume_;
    std::vector<std::size_t> place_;  // (k) of the rests in `paths_`
};

}  // namespace dicedesign
