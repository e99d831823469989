#include "hull/made_hull.hpp"

#include <limits>
#include <numeric>
#include <utility>

#include "hull/bounds.hpp"
#include "hull/coplanar.hpp"
#include "hull/quickhull.hpp"
#include "hull/spatial_order.hpp"

namespace dicedesign {
namespace {

constexpr std::size_t MOST_POINTS = std::numeric_limits<std::int32_t>::max() / 32;

// Points as multiples of 2^-51 up to 1, relative to half their extent.
struct GridPoints {
    GridPoints(const Vec* given, std::size_t count) : points(count), number(count) {
        const Bounds bounds(given, count);
        // Halved before they are added: the sum of two large ones is no double.
        const Vec middle = 0.5 * bounds.lower + 0.5 * bounds.upper;
        scale = bounds.reach(middle);
        valid = bounds.finite && scale >= std::numeric_limits<double>::min();
        if (!valid) return;
        relative_magnitude = bounds.magnitude() / scale;
        for (std::size_t i = 0; i < count; ++i) {
            const Vec local = given[i] - middle;
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

std::optional<HalfEdges> half_edges_of(const Vec* given, std::size_t count,
                                       double coplanar_tolerance, double precision) {
    if (count < 4 || count > MOST_POINTS) return std::nullopt;
    const GridPoints grid(given, count);
    if (!grid.valid) return std::nullopt;
    const double tolerance = coplanar_tolerance + 4.0 * precision * grid.relative_magnitude;
    const std::optional<Triangles> triangles = quickhull(grid.points, grid.number, tolerance);
    if (!triangles) return std::nullopt;
    const FacetLabels facets = facet_labels(grid.points, *triangles, tolerance);
    std::optional<HalfEdges> found = facet_loops(grid.number, *triangles, facets);
    if (found && has_edge_within(*found, given, grid.scale, tolerance)) return std::nullopt;
    return found;
}

Polyhedron polyhedron_of(const HalfEdges& edges, const std::vector<Vec>& vertices) {
    return {vertices.data(),
            static_cast<Index>(vertices.size()),
            edges.facet_start.data(),
            static_cast<Index>(edges.facet_start.size()) - 1,
            edges.tail.data(),
            edges.twin.data()};
}

}  // namespace

Polyhedron MadeHull::polyhedron() const { return polyhedron_of(edges, vertices); }

Hull MadeHull::hull() const {
    return {polyhedron(),
            connectivity.head.data(),
            connectivity.facet.data(),
            connectivity.next.data(),
            connectivity.previous.data(),
            connectivity.outgoing_start.data(),
            connectivity.outgoing.data(),
            measures.normals.data(),
            measures.areas.data()};
}

std::optional<MadeHull> make_hull(const Vec* points, std::size_t count, double coplanar_tolerance,
                                  double precision, const MeasureTolerances& tolerances) {
    std::optional<HalfEdges> edges = half_edges_of(points, count, coplanar_tolerance, precision);
    if (!edges) return std::nullopt;
    std::vector<Vec> vertices;
    vertices.reserve(edges->source.size());
    for (const Index i : edges->source) vertices.push_back(points[i]);
    const Polyhedron polyhedron = polyhedron_of(*edges, vertices);
    Connectivity connectivity(polyhedron);
    Measures measures(polyhedron, tolerances);
    return MadeHull{std::move(*edges), std::move(vertices), std::move(connectivity),
                    std::move(measures)};
}

}  // namespace dicedesign
