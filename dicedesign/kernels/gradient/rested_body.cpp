#include "gradient/rested_body.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "gradient/adjoint.hpp"
#include "hull/facets.hpp"
#include "rest/surroundings.hpp"

namespace dicedesign {

std::optional<RestedBody> RestedBody::of(const Vec* points, std::size_t count, const Vec* given,
                                         const RestTolerances& tolerances) {
    std::optional<MadeHull> made = make_hull(points, count, tolerances.coplanar,
                                             tolerances.precision, tolerances.measures);
    if (!made || !made->measures.has_normals || !made->measures.is_flat) return std::nullopt;
    if (given == nullptr && !made->measures.has_centroid) return std::nullopt;
    const Vec center = given == nullptr ? made->measures.centroid : *given;
    const Hull hull = made->hull();
    const Surroundings place = surroundings(hull, center);
    // Not a number either.
    if (!(place.height > tolerances.boundary * place.offset)) return std::nullopt;
    const double rounding = tolerances.measures.rounding;
    const double tie_distance = tolerances.tie * (place.far + place.extent);
    Elements elements;
    Separatrices paths;
    if (find_separatrices(hull, center, {rounding, tie_distance}, elements, paths) !=
        Verdict::certain) {
        return std::nullopt;
    }
    RestedBody body(std::move(*made), std::move(paths), center, given == nullptr,
                    tolerances.measures.thin_volume);
    const std::size_t rests = body.paths_.rests.size();
    std::vector<double> areas{4.0 * PI};
    if (rests > 1) {
        areas = signed_areas(hull, body.paths(), center, tolerances.near_antipode);
        if (!close_areas(areas, tolerances.closure)) return std::nullopt;
    }
    std::vector<double>& probabilities = areas;
    for (double& part : probabilities) part /= 4.0 * PI;
    body.place_.resize(rests);
    std::iota(body.place_.begin(), body.place_.end(), std::size_t{0});
    std::stable_sort(body.place_.begin(), body.place_.end(),
                     [&](std::size_t i, std::size_t j) { return probabilities[i] > probabilities[j]; });
    for (const std::size_t i : body.place_) {
        const Index facet = body.paths_.rests[i];
        body.facets.push_back(facet);
        body.normals.push_back(body.hull_.measures.normals[facet]);
        body.probabilities.push_back(probabilities[i]);
    }
    return body;
}

Paths RestedBody::paths() const {
    return {static_cast<Index>(paths_.rests.size()),
            static_cast<Index>(paths_.saddles.size()),
            paths_.rests.data(),
            paths_.basins.data(),
            paths_.saddle_ends.data(),
            paths_.crossings.data(),
            paths_.branch_start.data(),
            paths_.maxima.data()};
}

bool RestedBody::pull_back(const Vec* by_normals, const double* by_probabilities, Vec* by_points,
                           Vec& by_center) const {
    const Polyhedron hull = hull_.polyhedron();
    std::vector<Vec> by_vertices(hull_.vertices.size(), Vec{0.0, 0.0, 0.0});
    Vec moving{0.0, 0.0, 0.0};
    std::vector<double> weights(place_.size());
    for (std::size_t i = 0; i < place_.size(); ++i) weights[place_[i]] = by_probabilities[i] / (4.0 * PI);
    pull_back_areas(paths(), hull.vertices, center_, weights.data(), by_vertices.data(), moving);
    for (std::size_t i = 0; i < facets.size(); ++i) {
        const Vec& gradient = by_normals[i];
        if (gradient.x == 0.0 && gradient.y == 0.0 && gradient.z == 0.0) continue;
        const Direction normal(area_vector(hull, facets[i]));
        pull_back_area_vector(hull, facets[i], normal.pull_back(gradient), by_vertices.data());
    }
    if (uniform_) {
        if (!pull_back_centroid(hull, moving, thin_volume_, by_vertices.data())) return false;
    } else {
        by_center += moving;
    }
    for (std::size_t v = 0; v < by_vertices.size(); ++v)
        by_points[hull_.edges.source[v]] += by_vertices[v];
    return true;
}

}  // namespace dicedesign
