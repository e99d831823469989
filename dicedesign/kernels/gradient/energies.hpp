// The energies of dice design with their gradient, see dicedesign/optimize/energy.py.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "rest/areas.hpp"
#include "hull/facets.hpp"

namespace dicedesign {

// A body whose rests count for outcomes.
struct ClusteredBody {
    const Hull& hull;
    const Paths& paths;
    Vec center;
    const double* probabilities;  // (r)
};

// Which outcome each rest counts for, and what is wanted.
struct Outcomes {
    Index count;            // k
    const Index* of_rest;   // (r)
    const Vec* directions;  // (k)
    const double* target;   // (k)
    double radius;          // of the neighbor term
    double smallest_mean;   // length below which a sum of maxima is not stretched to 1
    double no_rest;         // what the barycenter term charges for an outcome without a rest
};

// One number for each energy: dice, coplanar, barycenter, neighbor.
using Terms = std::array<double, 4>;

class Energies {
public:
    // Body and outcomes must outlive this object. Terms that are not wanted stay 0.
    Energies(const ClusteredBody& body, const Outcomes& outcomes, const std::array<bool, 4>& wanted);

    Terms values() const;

    // Add the gradient of the sum of the terms times slopes to that in the vertices and in the
    // center.
    void pull_back(const Terms& slopes, Vec* by_vertices, Vec& by_center) const;

private:
    void find_regions();
    void pull_back_dice(double slope, Vec* by_vertices, Vec& by_center) const;
    void pull_back_normals(const Terms& slopes, Vec* by_vertices, Vec& by_center) const;
    double neighbor(double slope, Vec* by_vertices) const;

    const ClusteredBody& body_;
    const Outcomes& outcomes_;
    std::array<bool, 4> wanted_;
    std::vector<Direction> normals_;                // (r) of the rests
    std::vector<Index> members_;                    // (k) rests of each outcome
    std::vector<Vec> means_;                        // (k) of their normals
    std::vector<double> misses_;                    // (k) p - q
    std::vector<std::pair<Index, Index>> peaks_;    // outcomes with maxima on their border
    std::vector<Vec> sums_, barycenters_;           // (k) of those maxima
    std::vector<char> bordered_;                    // (k) whether there are any
};

}  // namespace dicedesign
