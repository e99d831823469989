// Kernels of `dicedesign.design`.

#include <nanobind/stl/array.h>

#include "adjoint.hpp"
#include "arrays.hpp"
#include "energies.hpp"

namespace dicedesign {
namespace {

using Rows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

Vec* vectors(std::vector<double>& numbers) { return reinterpret_cast<Vec*>(numbers.data()); }

nb::object numbers(const Vec& a) {
    return array(std::vector<double>{a.x, a.y, a.z});
}

Polygons polygons_of(const Indices& facet_start, const Indices& tail) {
    return {static_cast<Index>(facet_start.shape(0)) - 1, facet_start.data(), tail.data()};
}

// Gradients (n, 3) and (3,) of a weighted sum (k) of areas in the vertices and in the center.
nb::tuple area_gradient(IndexPairs basins, IndexPairs saddle_ends, IndexPairs crossings,
                        Indices branch_start, Indices maxima, Points vertices, Floats center,
                        Floats weights) {
    const Paths paths =
        paths_of(weights.shape(0), basins, saddle_ends, crossings, branch_start, maxima);
    std::vector<double> by_vertices(3 * vertices.shape(0));
    Vec by_center{0.0, 0.0, 0.0};
    pull_back_areas(paths, rows(vertices), vector(center), weights.data(), vectors(by_vertices),
                    by_center);
    return nb::make_tuple(array(std::move(by_vertices), 3), numbers(by_center));
}

// The same of each of `rests` areas: (k, 3 n) and (k, 3).
nb::tuple area_jacobian_rows(std::size_t rests, IndexPairs basins, IndexPairs saddle_ends,
                             IndexPairs crossings, Indices branch_start, Indices maxima,
                             Points vertices, Floats center) {
    const Paths paths = paths_of(rests, basins, saddle_ends, crossings, branch_start, maxima);
    const std::size_t count = vertices.shape(0);
    std::vector<double> by_vertices(3 * count * rests), by_center(3 * rests);
    area_jacobian(paths, rows(vertices), static_cast<Index>(count), vector(center),
                  vectors(by_vertices), vectors(by_center));
    return nb::make_tuple(array(std::move(by_vertices), 3 * count),
                          array(std::move(by_center), 3));
}

// Gradient (n, 3) in the vertices for that (3,) in the centroid of the uniform solid; None where
// the body is thin.
nb::object centroid_gradient(Indices facet_start, Indices tail, Points vertices, Floats gradient,
                             double thin_volume) {
    std::vector<double> by_vertices(3 * vertices.shape(0));
    if (!pull_back_centroid(polygons_of(facet_start, tail), rows(vertices),
                            static_cast<Index>(vertices.shape(0)), vector(gradient), thin_volume,
                            vectors(by_vertices))) {
        return nb::none();
    }
    return array(std::move(by_vertices), 3);
}

// Gradient (n, 3) in the vertices for those (k, 3) in the unit normals of facets (k).
nb::object normal_gradient(Indices facet_start, Indices tail, Points vertices, Indices facets,
                           Points gradients) {
    const Polygons polygons = polygons_of(facet_start, tail);
    std::vector<double> by_vertices(3 * vertices.shape(0));
    for (std::size_t i = 0; i < facets.shape(0); ++i) {
        const Direction normal(area_vector(polygons, facets(i), rows(vertices)));
        pull_back_area_vector(polygons, facets(i), rows(vertices),
                              normal.pull_back(rows(gradients)[i]), vectors(by_vertices));
    }
    return array(std::move(by_vertices), 3);
}

// Depths (m) of the facets.
nb::object depths(Indices facet_start, Indices tail, Points vertices, Floats center) {
    return array(facet_depths(polygons_of(facet_start, tail), rows(vertices),
                              static_cast<Index>(vertices.shape(0)), vector(center)));
}

// Gradients (n, 3) and (3,) of a weighted sum (m) of depths in the vertices and in the center.
nb::tuple depth_gradient(Indices facet_start, Indices tail, Points vertices, Floats center,
                         Floats weights) {
    std::vector<double> by_vertices(3 * vertices.shape(0));
    Vec by_center{0.0, 0.0, 0.0};
    pull_back_depths(polygons_of(facet_start, tail), rows(vertices),
                     static_cast<Index>(vertices.shape(0)), vector(center), weights.data(),
                     vectors(by_vertices), by_center);
    return nb::make_tuple(array(std::move(by_vertices), 3), numbers(by_center));
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

// The energies of a body with the arrays that they are computed from.
class BoundEnergies {
public:
    BoundEnergies(IndexPairs basins, IndexPairs saddle_ends, IndexPairs crossings,
                  Indices branch_start, Indices maxima, Indices rests, Indices facet_start,
                  Indices tail, Points vertices, Floats center, Points normals,
                  Floats probabilities, Indices of_rest, Points directions, Floats target,
                  double radius, double smallest_mean, std::array<bool, 4> wanted)
        : pairs_{basins, saddle_ends, crossings},
          indices_{branch_start, maxima, rests, facet_start, tail, of_rest},
          points_{vertices, normals, directions},
          floats_{probabilities, target},
          vertex_count_(vertices.shape(0)),
          paths_(paths_of(rests.shape(0), basins, saddle_ends, crossings, branch_start, maxima)),
          facets_(polygons_of(facet_start, tail)),
          body_{paths_,         facets_,       rests.data(),  probabilities.data(),
                rows(vertices), rows(normals), vector(center)},
          outcomes_{static_cast<Index>(directions.shape(0)),
                    of_rest.data(),
                    rows(directions),
                    target.data(),
                    radius,
                    smallest_mean},
          energies_(body_, outcomes_, wanted) {}

    BoundEnergies(const BoundEnergies&) = delete;

    // The terms: dice, coplanar, barycenter, neighbor; 0 where they are not wanted.
    Terms values() const { return energies_.values(); }

    // Gradients (n, 3) and (3,) of the sum of the terms times slopes in the vertices and in the
    // center.
    nb::tuple gradient(const Terms& slopes) const {
        std::vector<double> by_vertices(3 * vertex_count_);
        Vec by_center{0.0, 0.0, 0.0};
        energies_.pull_back(slopes, vectors(by_vertices), by_center);
        return nb::make_tuple(array(std::move(by_vertices), 3), numbers(by_center));
    }

private:
    // Kept, for what follows reads from them.
    std::array<IndexPairs, 3> pairs_;
    std::array<Indices, 6> indices_;
    std::array<Points, 3> points_;
    std::array<Floats, 2> floats_;
    std::size_t vertex_count_;
    Paths paths_;
    Polygons facets_;
    Body body_;
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
    nb::class_<BoundEnergies>(module, "Energies")
        .def(nb::init<IndexPairs, IndexPairs, IndexPairs, Indices, Indices, Indices, Indices,
                      Indices, Points, Floats, Points, Floats, Indices, Points, Floats, double,
                      double, std::array<bool, 4>>())
        .def("values", &BoundEnergies::values)
        .def("gradient", &BoundEnergies::gradient);
}

}  // namespace dicedesign
