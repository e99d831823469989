// Kernels of `dicedesign.gradient` and `dicedesign.optimize`.

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <optional>

#include "arrays.hpp"
#include "gradient/adjoint.hpp"
#include "gradient/energies.hpp"
#include "gradient/rested_body.hpp"
#include "hull/handle.hpp"
#include "parallel.hpp"
#include "rest/paths.hpp"

namespace dicedesign {
namespace {

// Room for a gradient in the vertices.
std::vector<double> zeros(const HullHandle& hull, std::size_t rows = 1) {
    return std::vector<double>(3 * static_cast<std::size_t>(hull->vertex_count) * rows);
}

using Blocks = nb::ndarray<const double, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

// Bodies that were put to rest together, but those that rounding leaves open.
class BodiesHandle {
public:
    // Body i has the points (t, 3) from `start[i]` on, `counts[i]` of them, and center i of `centers`
    // (b, 3), or without these that of the uniform solid.
    BodiesHandle(Points points, Indices start, Indices counts, std::optional<Points> centers,
                 const std::array<double, 9>& numbers, std::size_t threads)
        : bodies_(start.shape(0)) {
        const auto [coplanar, precision, sliver, thin_volume, rounding, boundary, tie,
                    near_antipode, closure] = numbers;
        const RestTolerances tolerances{coplanar, precision, {sliver, thin_volume, rounding},
                                        boundary, tie,       near_antipode,
                                        closure};
        const Vec* given = centers ? rows(*centers) : nullptr;
        const nb::gil_scoped_release others_may_run;
        in_parallel(bodies_.size(), threads, [&](std::size_t i) {
            bodies_[i] = RestedBody::of(rows(points) + start(i), counts(i),
                                        given == nullptr ? nullptr : given + i, tolerances);
        });
    }

    BodiesHandle(const BodiesHandle&) = delete;

    // How many rests each body has (b), 0 where that is open, then with as many rows for each as
    // the most have their facets (b, k), normals (b, k, 3) and probabilities (b, k), 0 in rows too many.
    nb::tuple rests() const {
        const std::size_t count = bodies_.size();
        std::vector<Index> found(count);
        for (std::size_t i = 0; i < count; ++i)
            if (bodies_[i]) found[i] = static_cast<Index>(bodies_[i]->probabilities.size());
        const std::size_t most = found.empty() ? 0 : *std::max_element(found.begin(), found.end());
        std::vector<Index> facets(count * most);
        std::vector<Vec> normals(count * most, Vec{0.0, 0.0, 0.0});
        std::vector<double> probabilities(count * most);
        for (std::size_t i = 0; i < count; ++i) {
            if (!bodies_[i]) continue;
            const RestedBody& body = *bodies_[i];
            std::copy(body.facets.begin(), body.facets.end(), facets.begin() + i * most);
            std::copy(body.normals.begin(), body.normals.end(), normals.begin() + i * most);
            std::copy(body.probabilities.begin(), body.probabilities.end(), probabilities.begin() + i * most);
        }
        const std::size_t shape[3] = {count, most, 3};
        return nb::make_tuple(array(std::move(found)), owning<Index>(std::move(facets), 2, shape),
                              owning<double>(std::move(normals), 3, shape),
                              owning<double>(std::move(probabilities), 2, shape));
    }

    // Gradients (r, n, 3) in points and (r, 3) in centers for those (r, k, 3) in normals and (r, k)
    // in probabilities of bodies (r), n of the most points; and (r) 0 where one is left open.
    nb::tuple pull_back(Indices which, Blocks by_normals, Rows by_probabilities, std::size_t most_points,
                        std::size_t threads) const {
        const std::size_t count = which.shape(0), rests = by_probabilities.shape(1);
        std::vector<Vec> by_points(count * most_points, Vec{0.0, 0.0, 0.0});
        std::vector<Vec> by_centers(count, Vec{0.0, 0.0, 0.0});
        std::vector<Index> known(count);
        const auto* normals = reinterpret_cast<const Vec*>(by_normals.data());
        {
            const nb::gil_scoped_release others_may_run;
            in_parallel(count, threads, [&](std::size_t i) {
                const std::optional<RestedBody>& body = bodies_[which(i)];
                known[i] = body && body->pull_back(normals + i * rests, by_probabilities.data() + i * rests,
                                                   by_points.data() + i * most_points,
                                                   by_centers[i]);
            });
        }
        const std::size_t shape[3] = {count, most_points, 3};
        return nb::make_tuple(owning<double>(std::move(by_points), 3, shape),
                              array(std::move(by_centers)), array(std::move(known)));
    }

private:
    std::vector<std::optional<RestedBody>> bodies_;
};

// Gradients (n, 3) and (3,) of a weighted sum (k) of areas in the vertices and in the center.
nb::tuple area_gradient(const HullHandle& hull, const PathsHandle& paths, Floats center,
                        Floats weights) {
    std::vector<double> by_vertices = zeros(hull);
    Vec by_center{0.0, 0.0, 0.0};
    pull_back_areas(*paths, hull->vertices, vector(center), weights.data(), vectors(by_vertices),
                    by_center);
    return nb::make_tuple(array(std::move(by_vertices), 3), array(by_center));
}

// The same of each area: (k, 3 n) and (k, 3).
nb::tuple area_jacobian_rows(const HullHandle& hull, const PathsHandle& paths, Floats center) {
    const auto rests = static_cast<std::size_t>(paths->rests);
    std::vector<double> by_vertices = zeros(hull, rests), by_center(3 * rests);
    area_jacobian(*paths, hull->vertices, hull->vertex_count, vector(center),
                  vectors(by_vertices), vectors(by_center));
    return nb::make_tuple(array(std::move(by_vertices),
                                3 * static_cast<std::size_t>(hull->vertex_count)),
                          array(std::move(by_center), 3));
}

// Gradient (n, 3) in the vertices for that (3,) in the centroid of the uniform solid; None where
// the body is thin.
nb::object centroid_gradient(const HullHandle& hull, Floats gradient, double thin_volume) {
    std::vector<double> by_vertices = zeros(hull);
    if (!pull_back_centroid(*hull, vector(gradient), thin_volume, vectors(by_vertices))) {
        return nb::none();
    }
    return array(std::move(by_vertices), 3);
}

// Gradient (n, 3) in the vertices for those (k, 3) in the unit normals of facets (k).
nb::object normal_gradient(const HullHandle& hull, Indices facets, Points gradients) {
    std::vector<double> by_vertices = zeros(hull);
    for (std::size_t i = 0; i < facets.shape(0); ++i) {
        const Direction normal(area_vector(*hull, facets(i)));
        pull_back_area_vector(*hull, facets(i), normal.pull_back(rows(gradients)[i]),
                              vectors(by_vertices));
    }
    return array(std::move(by_vertices), 3);
}

// Depths (m) of the facets.
nb::object depths(const HullHandle& hull, Floats center) {
    return array(facet_depths(*hull, vector(center)));
}

// Gradients (n, 3) and (3,) of a weighted sum (m) of depths in the vertices and in the center.
nb::tuple depth_gradient(const HullHandle& hull, Floats center, Floats weights) {
    std::vector<double> by_vertices = zeros(hull);
    Vec by_center{0.0, 0.0, 0.0};
    pull_back_depths(*hull, vector(center), weights.data(), vectors(by_vertices), by_center);
    return nb::make_tuple(array(std::move(by_vertices), 3), array(by_center));
}

// Gradients (r, 4 m) in half-spaces, all normals and then all logarithms of distances, for those
// (r, 3 t) in corners (t, 3) relative to the point that distances are measured from; see
// `pull_back_corners`.
nb::object corner_gradients(Points normals, Points polar, Indices planes, Points corners,
                            Rows gradients) {
    const std::size_t many = gradients.shape(0), count = normals.shape(0);
    const std::size_t corner_count = corners.shape(0);
    std::vector<double> found(4 * count * many);
    for (std::size_t row = 0; row < many; ++row) {
        double* to = found.data() + 4 * count * row;
        const double* from = gradients.data() + 3 * corner_count * row;
        pull_back_corners(rows(normals), rows(polar), planes.data(), rows(corners),
                          static_cast<Index>(corner_count), static_cast<Index>(count),
                          reinterpret_cast<const Vec*>(from), reinterpret_cast<Vec*>(to),
                          to + 3 * count);
    }
    return array(std::move(found), 4 * count);
}

// The energies of a body with what they are computed from, which is kept.
class EnergiesHandle {
public:
    EnergiesHandle(const HullHandle& hull, const PathsHandle& paths, Floats center,
                   Floats probabilities, Indices of_rest, Points directions, Floats target,
                   double radius, double smallest_mean, double no_rest, std::array<bool, 4> wanted)
        : hull_(hull),
          paths_(paths),
          floats_{probabilities, target},
          of_rest_(of_rest),
          directions_(directions),
          body_{*hull_, *paths_, vector(center), probabilities.data()},
          outcomes_{static_cast<Index>(directions.shape(0)),
                    of_rest.data(),
                    rows(directions),
                    target.data(),
                    radius,
                    smallest_mean,
                    no_rest},
          energies_(body_, outcomes_, wanted) {}

    EnergiesHandle(const EnergiesHandle&) = delete;

    // The terms: dice, coplanar, barycenter, neighbor; 0 where they are not wanted.
    Terms values() const { return energies_.values(); }

    // Gradients (n, 3) and (3,) of the sum of the terms times slopes in the vertices and in the
    // center.
    nb::tuple gradient(const Terms& slopes) const {
        std::vector<double> by_vertices = zeros(hull_);
        Vec by_center{0.0, 0.0, 0.0};
        energies_.pull_back(slopes, vectors(by_vertices), by_center);
        return nb::make_tuple(array(std::move(by_vertices), 3), array(by_center));
    }

private:
    HullHandle hull_;
    PathsHandle paths_;
    std::array<Floats, 2> floats_;
    Indices of_rest_;
    Points directions_;
    ClusteredBody body_;
    Outcomes outcomes_;
    Energies energies_;
};

}  // namespace

void bind_gradients(nb::module_& module) {
    module.def("area_gradient", &area_gradient);
    module.def("area_jacobian", &area_jacobian_rows);
    module.def("centroid_gradient", &centroid_gradient);
    module.def("corner_gradients", &corner_gradients);
    module.def("normal_gradient", &normal_gradient);
    module.def("facet_depths", &depths);
    module.def("depth_gradient", &depth_gradient);
    nb::class_<BodiesHandle>(module, "Bodies")
        .def(nb::init<Points, Indices, Indices, std::optional<Points>,
                      const std::array<double, 9>&, std::size_t>(),
             nb::arg(), nb::arg(), nb::arg(), nb::arg().none(), nb::arg(), nb::arg())
        .def("rests", &BodiesHandle::rests)
        .def("pull_back", &BodiesHandle::pull_back);
    nb::class_<EnergiesHandle>(module, "Energies")
        .def(nb::init<const HullHandle&, const PathsHandle&, Floats, Floats, Indices, Points,
                      Floats, double, double, double, std::array<bool, 4>>())
        .def("values", &EnergiesHandle::values)
        .def("gradient", &EnergiesHandle::gradient);
}

}  // namespace dicedesign
