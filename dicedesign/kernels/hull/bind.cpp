// Points and their convex hulls: repeated positions, hull, connectivity and measures.
#include <nanobind/stl/array.h>

#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "arrays.hpp"
#include "hull/check.hpp"
#include "hull/coplanar.hpp"
#include "hull/half_edges.hpp"
#include "hull/handle.hpp"
#include "hull/measures.hpp"
#include "hull/quickhull.hpp"
#include "hull/repeated.hpp"
#include "hull/spatial_order.hpp"

namespace dicedesign {
namespace {

constexpr std::size_t MOST_POINTS = std::numeric_limits<std::int32_t>::max() / 32;

// The box around points, and whether all of them are finite.
struct Bounds : Box {
    explicit Bounds(const Points& points) : Box(rows(points)[0]) {
        double total = 0.0;
        for (std::size_t i = 0; i < points.shape(0); ++i) {
            const Vec& p = rows(points)[i];
            add(p);
            total += 0.0 * p.x + 0.0 * p.y + 0.0 * p.z;
        }
        // Zero times what is missing or infinite is not zero.
        finite = total == 0.0;
    }

    bool finite;
};

// Points as multiples of 2^-51 up to 1, relative to half their extent.
struct GridPoints {
    explicit GridPoints(const Points& given) : points(given.shape(0)), number(points.size()) {
        const Bounds bounds(given);
        // Halved before they are added: the sum of two large ones is no double.
        const Vec middle = 0.5 * bounds.lower + 0.5 * bounds.upper;
        scale = bounds.reach(middle);
        valid = bounds.finite && scale >= std::numeric_limits<double>::min();
        if (!valid) return;
        relative_magnitude = bounds.magnitude() / scale;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vec local = rows(given)[i] - middle;
            points[i] = {on_grid(local.x / scale), on_grid(local.y / scale),
                         on_grid(local.z / scale)};
        }
        sort();
    }

    std::vector<Vec> points;
    std::vector<int> number;  // in which row a point was given
    double scale = 0.0;
    double relative_magnitude = 0.0;  // largest coordinate over half the extent
    bool valid;                       // finite and not all in one place

private:
    // Numbers from 2 to 4 have no finer digits.
    static double on_grid(double x) { return (x + 3.0) - 3.0; }

    // Many points are looked up faster where they are near each other.
    void sort() {
        if (points.size() < 20000) {
            std::iota(number.begin(), number.end(), 0);
            return;
        }
        number = spatial_order(points);
        std::vector<Vec> sorted(points.size());
        for (std::size_t i = 0; i < points.size(); ++i) sorted[i] = points[number[i]];
        points = std::move(sorted);
    }
};

bool has_edge_within(const HalfEdges& edges, const Vec* points, double scale, double distance) {
    for (std::size_t h = 0; h < edges.tail.size(); ++h) {
        if (edges.twin[h] < static_cast<Index>(h)) continue;
        const Vec& tail = points[edges.source[edges.tail[h]]];
        const Vec& head = points[edges.source[edges.tail[edges.twin[h]]]];
        const Vec along = head - tail;
        if (norm({along.x / scale, along.y / scale, along.z / scale}) <= distance) return true;
    }
    return false;
}

std::optional<HalfEdges> hull_of(const Points& given, double coplanar_tolerance,
                                 double precision) {
    if (given.shape(0) < 4 || given.shape(0) > MOST_POINTS) return std::nullopt;
    const GridPoints grid(given);
    if (!grid.valid) return std::nullopt;
    const double tolerance = coplanar_tolerance + 4.0 * precision * grid.relative_magnitude;
    const std::optional<Triangles> triangles = quickhull(grid.points, grid.number, tolerance);
    if (!triangles) return std::nullopt;
    const FacetLabels facets = facet_labels(grid.points, *triangles, tolerance);
    std::optional<HalfEdges> found = facet_loops(grid.number, *triangles, facets);
    if (found && has_edge_within(*found, rows(given), grid.scale, tolerance)) return std::nullopt;
    return found;
}

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

nb::object convex_hull(const Points& given, double coplanar_tolerance, double precision,
                       double sliver, double thin_volume, double rounding) {
    std::optional<HalfEdges> edges = hull_of(given, coplanar_tolerance, precision);
    if (!edges) return nb::none();
    std::vector<Vec> vertices;
    vertices.reserve(edges->source.size());
    for (const Index i : edges->source) vertices.push_back(rows(given)[i]);
    const Polyhedron polyhedron{vertices.data(),
                                static_cast<Index>(vertices.size()),
                                edges->facet_start.data(),
                                static_cast<Index>(edges->facet_start.size()) - 1,
                                edges->tail.data(),
                                edges->twin.data()};
    Connectivity connectivity(polyhedron);
    Measures measures(polyhedron, {sliver, thin_volume, rounding});
    // A vector that is moved keeps its numbers where they are.
    const Hull hull{polyhedron,
                    connectivity.head.data(),
                    connectivity.facet.data(),
                    connectivity.next.data(),
                    connectivity.previous.data(),
                    connectivity.outgoing_start.data(),
                    connectivity.outgoing.data(),
                    measures.normals.data(),
                    measures.areas.data()};
    const bool is_whole = measures.has_normals;
    nb::dict found;
    put_connectivity(found, std::move(connectivity));
    put_measures(found, std::move(measures));
    found["vertices"] = array(std::move(vertices));
    found["source"] = array(std::move(edges->source));
    found["facet_start"] = array(std::move(edges->facet_start));
    found["tail"] = array(std::move(edges->tail));
    found["twin"] = array(std::move(edges->twin));
    if (is_whole) {
        std::vector<nb::object> owners;
        for (const auto& item : found) owners.push_back(nb::borrow(item.second));
        found["handle"] = nb::cast(HullHandle(hull, std::move(owners)));
    }
    return found;
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
    const Bounds bounds(points);
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
    module.def("hull_properties", &hull_properties);
}

}  // namespace dicedesign
