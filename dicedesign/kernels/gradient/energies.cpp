#include "gradient/energies.hpp"

#include <algorithm>

#include "gradient/adjoint.hpp"

namespace dicedesign {
namespace {

enum Term { DICE, COPLANAR, BARYCENTER, NEIGHBOR };

double squared(const Vec& a) { return dot(a, a); }

}  // namespace

Energies::Energies(const ClusteredBody& body, const Outcomes& outcomes,
                   const std::array<bool, 4>& wanted)
    : body_(body), outcomes_(outcomes), wanted_(wanted) {
    const std::size_t rests = static_cast<std::size_t>(body.paths.rests);
    const std::size_t count = static_cast<std::size_t>(outcomes.count);
    misses_.resize(count);
    members_.resize(count);
    for (std::size_t k = 0; k < count; ++k) misses_[k] = -outcomes.target[k];
    for (std::size_t r = 0; r < rests; ++r) {
        misses_[outcomes.of_rest[r]] += body.probabilities[r];
        ++members_[outcomes.of_rest[r]];
    }
    if (!wanted[COPLANAR] && !wanted[BARYCENTER]) return;
    normals_.reserve(rests);
    means_.resize(count, Vec{0.0, 0.0, 0.0});
    for (std::size_t r = 0; r < rests; ++r) {
        normals_.emplace_back(area_vector(body.hull, body.paths.resting[r]));
        Vec& mean = means_[outcomes.of_rest[r]];
        mean = mean + normals_[r].unit;
    }
    for (std::size_t k = 0; k < count; ++k) {
        if (members_[k] > 0) means_[k] = (1.0 / static_cast<double>(members_[k])) * means_[k];
    }
    if (wanted[BARYCENTER]) find_regions();
}

void Energies::find_regions() {
    const Paths& paths = body_.paths;
    for (Index s = 0; s < paths.saddles; ++s) {
        const Index left = outcomes_.of_rest[paths.basins[2 * s]];
        const Index right = outcomes_.of_rest[paths.basins[2 * s + 1]];
        if (left == right) continue;
        for (const Index outcome : {left, right}) {
            peaks_.emplace_back(outcome, paths.maxima[2 * s]);
            peaks_.emplace_back(outcome, paths.maxima[2 * s + 1]);
        }
    }
    std::sort(peaks_.begin(), peaks_.end());
    peaks_.erase(std::unique(peaks_.begin(), peaks_.end()), peaks_.end());
    const std::size_t count = static_cast<std::size_t>(outcomes_.count);
    sums_.resize(count, Vec{0.0, 0.0, 0.0});
    bordered_.resize(count);
    for (const auto& [outcome, peak] : peaks_) {
        const Vec up = Direction(body_.hull.vertices[peak] - body_.center).unit;
        sums_[outcome] = sums_[outcome] + up;
        bordered_[outcome] = 1;
    }
    barycenters_ = sums_;
    for (Vec& mean : barycenters_) {
        mean = (1.0 / std::fmax(norm(mean), outcomes_.smallest_mean)) * mean;
    }
}

Terms Energies::values() const {
    Terms terms{};
    for (std::size_t k = 0; k < misses_.size(); ++k) {
        terms[DICE] += misses_[k] * misses_[k];
        if (wanted_[BARYCENTER] && members_[k] == 0) terms[BARYCENTER] += outcomes_.no_rest;
    }
    for (std::size_t r = 0; r < normals_.size(); ++r) {
        const Index outcome = outcomes_.of_rest[r];
        // All ordered pairs of n normals: 2 n times the squared distances from their mean.
        const double members = static_cast<double>(members_[outcome]);
        if (wanted_[COPLANAR]) {
            terms[COPLANAR] += 2.0 * members * squared(normals_[r].unit - means_[outcome]);
        }
        if (wanted_[BARYCENTER] && bordered_[outcome]) {
            terms[BARYCENTER] += squared(normals_[r].unit - barycenters_[outcome]);
        }
    }
    if (wanted_[NEIGHBOR]) terms[NEIGHBOR] = neighbor(0.0, nullptr);
    return terms;
}

void Energies::pull_back(const Terms& slopes, Vec* by_vertices, Vec& by_center) const {
    if (slopes[DICE] != 0.0) pull_back_dice(slopes[DICE], by_vertices, by_center);
    if (slopes[COPLANAR] != 0.0 || slopes[BARYCENTER] != 0.0) {
        pull_back_normals(slopes, by_vertices, by_center);
    }
    if (slopes[NEIGHBOR] != 0.0) neighbor(slopes[NEIGHBOR], by_vertices);
}

void Energies::pull_back_dice(double slope, Vec* by_vertices, Vec& by_center) const {
    std::vector<double> by_area(static_cast<std::size_t>(body_.paths.rests));
    for (std::size_t r = 0; r < by_area.size(); ++r) {
        by_area[r] = slope * 2.0 * misses_[outcomes_.of_rest[r]] / (4.0 * PI);
    }
    pull_back_areas(body_.paths, body_.hull.vertices, body_.center, by_area.data(), by_vertices,
                    by_center);
}

// Of the coplanar and the barycenter term.
void Energies::pull_back_normals(const Terms& slopes, Vec* by_vertices, Vec& by_center) const {
    const double barycenter = 2.0 * slopes[BARYCENTER];
    std::vector<Vec> by_mean(means_.size(), Vec{0.0, 0.0, 0.0});
    for (std::size_t r = 0; r < normals_.size(); ++r) {
        const Index outcome = outcomes_.of_rest[r];
        const Vec& normal = normals_[r].unit;
        const double members = static_cast<double>(members_[outcome]);
        Vec gradient = (4.0 * slopes[COPLANAR] * members) * (normal - means_[outcome]);
        if (barycenter != 0.0 && bordered_[outcome]) {
            const Vec away = barycenter * (normal - barycenters_[outcome]);
            gradient = gradient + away;
            by_mean[outcome] = by_mean[outcome] - away;
        }
        pull_back_area_vector(body_.hull, body_.paths.resting[r],
                              normals_[r].pull_back(gradient), by_vertices);
    }
    for (const auto& [outcome, peak] : peaks_) {
        const double length = norm(sums_[outcome]);
        Vec by_sum = (1.0 / outcomes_.smallest_mean) * by_mean[outcome];
        if (length > outcomes_.smallest_mean) {
            by_sum = Direction(sums_[outcome]).pull_back(by_mean[outcome]);
        }
        const Vec gradient = Direction(body_.hull.vertices[peak] - body_.center).pull_back(by_sum);
        by_vertices[peak] = by_vertices[peak] + gradient;
        by_center = by_center - gradient;
    }
}

// The value of the neighbor term; its gradient times a slope is added where a place is given.
double Energies::neighbor(double slope, Vec* by_vertices) const {
    const double limit = outcomes_.radius * outcomes_.radius;
    double total = 0.0;
    for (Index k = 0; k < outcomes_.count; ++k) {
        bool alone = true;
        for (Index f = 0; f < body_.hull.facet_count; ++f) {
            if (!(squared(outcomes_.directions[k] - body_.hull.normals[f]) < limit)) continue;
            alone = false;
            const Direction normal(area_vector(body_.hull, f));
            const Vec offset = normal.unit - outcomes_.directions[k];
            total += squared(offset);
            if (by_vertices != nullptr) {
                const Vec gradient = normal.pull_back((2.0 * slope) * offset);
                pull_back_area_vector(body_.hull, f, gradient, by_vertices);
            }
        }
        if (alone) total += limit;
    }
    return total;
}

}  // namespace dicedesign
