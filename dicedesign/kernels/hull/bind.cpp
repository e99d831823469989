// Points and their convex hulls: repeated positions, hull, connectivity and measures.
#include <nanobind/stl/array.h>

#include <optional>
#include <vector>

#include "arrays.hpp"
#include "hull/bounds.hpp"
#include "hull/check.hpp"
#include "hull/handle.hpp"
#include "hull/made_hull.hpp"
#include "hull/measures.hpp"
#include "hull/repeated.hpp"

namespace dicedesign {
namespace {

void put_measures(nb::dict& found, Measures&& measures) {
    if (measures.has_normals) {
        found["normals"] = array(std::move(measures.normals));
        found["areas"] = array(std::move(measures.areas));
        found["unevenness"] = measures.unevenness;
        if (measures.is_flat) found["warp"] = 0.0;
    }
    if (measures.has_centroid) found["centroid"] = array(measures.centroid);
}

void put_connectivity(nb::dict& found, Connectivity&& connectivity) {
    found["facet"] = array(std::move(connectivity.facet));
    found["next"] = array(std::move(connectivity.next));
    found["previous"] = array(std::move(connectivity.previous));
    found["head"] = array(std::move(connectivity.head));
    found["outgoing"] = nb::make_tuple(array(std::move(connectivity.outgoing_start)),
                                       array(std::move(connectivity.outgoing)));
}

// Fields and measures of a `ConvexHull`. A vector that is moved keeps its numbers where they are.
nb::dict measured_hull(MeasuredHull&& made) {
    nb::dict found;
    put_measures(found, std::move(made.measures));
    found["vertices"] = array(std::move(made.vertices));
    found["source"] = array(std::move(made.edges.source));
    found["facet_start"] = array(std::move(made.edges.facet_start));
    found["tail"] = array(std::move(made.edges.tail));
    found["twin"] = array(std::move(made.edges.twin));
    return found;
}

// All that kernels use, and a handle.
nb::dict whole_hull(MadeHull&& made) {
    const Hull hull = made.hull();
    const bool is_whole = made.measures.has_normals;
    Connectivity connectivity = std::move(made.connectivity);
    nb::dict found = measured_hull(std::move(made));
    put_connectivity(found, std::move(connectivity));
    if (is_whole) {
        std::vector<nb::object> owners;
        for (const auto& item : found) owners.push_back(nb::borrow(item.second));
        found["handle"] = nb::cast(HullHandle(hull, std::move(owners)));
    }
    return found;
}

nb::object convex_hull(const Points& given, double coplanar_tolerance, double precision,
                       double sliver, double thin_volume, double rounding) {
    std::optional<MadeHull> made = make_hull(rows(given), given.shape(0), coplanar_tolerance,
                                             precision, {sliver, thin_volume, rounding});
    return made ? nb::object(whole_hull(std::move(*made))) : nb::none();
}

// The hull, and its facets merged with their numbers, or None for both.
nb::object exact_hull(const Points& given, double coplanar_tolerance, double precision,
                      double sliver, double thin_volume, double rounding) {
    std::optional<ExactHull> made =
        make_exact_hull(rows(given), given.shape(0), coplanar_tolerance, precision,
                        {sliver, thin_volume, rounding});
    if (!made) return nb::none();
    nb::object merged = nb::none(), numbers = nb::none();
    if (made->merged) {
        merged = measured_hull(std::move(*made->merged));
        numbers = array(std::move(made->merged_facet));
    }
    return nb::make_tuple(whole_hull(std::move(made->hull)), merged, numbers);
}

nb::dict hull_properties(const Points& vertices, const Indices& facet_start, const Indices& tail,
                         const Indices& twin, double sliver, double thin_volume, double rounding) {
    const Polyhedron hull = polyhedron_of(vertices, facet_start, tail, twin);
    nb::dict found;
    put_connectivity(found, Connectivity(hull));
    put_measures(found, Measures(hull, {sliver, thin_volume, rounding}));
    return found;
}

// The properties of a hull with moved vertices, if that is certainly the hull of all the points;
// False where it is in doubt.
nb::object moved_hull(const Points& points, const Indices& source, const Indices& facet_start,
                      const Indices& tail, const Indices& twin, std::array<double, 5> reuse,
                      double sliver, double thin_volume, double rounding) {
    std::vector<Vec> vertices, others;
    vertices.reserve(source.shape(0));
    const Index* next = source.data();
    for (std::size_t i = 0; i < points.shape(0); ++i) {
        const bool is_vertex = next != source.data() + source.shape(0) && *next == Index(i);
        (is_vertex ? vertices : others).push_back(rows(points)[i]);
        next += is_vertex;
    }
    if (vertices.size() != source.shape(0)) return nb::bool_(false);
    const Polyhedron hull{vertices.data(),    static_cast<Index>(vertices.size()),
                          facet_start.data(), static_cast<Index>(facet_start.shape(0)) - 1,
                          tail.data(),        twin.data()};
    Measures measures(hull, {sliver, thin_volume, rounding});
    const auto [flatness, margin, leverage, turn, offset] = reuse;
    if (!is_convex(hull, measures, others, {flatness, margin, leverage, turn, offset}))
        return nb::bool_(false);
    nb::dict found;
    put_measures(found, std::move(measures));
    found["vertices"] = array(std::move(vertices));
    return found;
}

// Whether coordinates are finite and of a size that a body may have.
bool are_proper(const Points& points, double smallest_extent) {
    if (points.shape(0) == 0) return false;
    const Bounds bounds(rows(points), points.shape(0));
    return bounds.finite && bounds.magnitude() <= 1.0 / smallest_extent &&
           bounds.extent() >= smallest_extent;
}

// The first point at each position, in order, and of each point the place of its position; False
// where all are at different positions.
nb::object repeated_positions(const Points& points) {
    Positions found = distinct_positions(rows(points), points.shape(0));
    if (found.first.size() == points.shape(0)) return nb::bool_(false);
    return nb::make_tuple(array(std::move(found.first)), array(std::move(found.group)));
}

}  // namespace

void bind_hull(nb::module_& module) {
    nb::class_<HullHandle>(module, "Hull")
        .def(nb::init<Points, Indices, Indices, Indices, Indices, Indices, Indices, Indices,
                      Indices, Indices, Points, Floats>());
    module.def("are_proper", &are_proper);
    module.def("repeated_positions", &repeated_positions);
    module.def("moved_hull", &moved_hull);
    module.def("convex_hull", &convex_hull);
    module.def("exact_hull", &exact_hull);
    module.def("hull_properties", &hull_properties);
}

}  // namespace dicedesign
