#include "hull/made_hull.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "hull/bounds.hpp"
#include "hull/coplanar.hpp"
#include "hull/quickhull.hpp"
#include "hull/spatial_order.hpp"
#include "twofold.hpp"

namespace dicedesign {
namespace {

constexpr std::size_t MOST_POINTS = std::numeric_limits<std::int32_t>::max() / 32;

// Points moved to the middle and scaled so that no coordinate exceeds 1: by powers of two without
// rounding, or to multiples of 2^-51, where points that differ by rounding alone become one.
struct PlacedPoints {
    PlacedPoints(const Vec* given, std::size_t count, bool exact)
        : points(given, given + count), number(count) {
        const Bounds bounds(given, count);
        // Halved before they are added: the sum of two large ones is no double.
        const Vec middle = 0.5 * bounds.lower + 0.5 * bounds.upper;
        unit = reach_ = bounds.reach(middle);
        magnitude_ = bounds.magnitude();
        valid = bounds.finite && reach_ >= std::numeric_limits<double>::min();
        if (!valid) return;
        if (exact) {
            move_near(middle);
            shrink();
            valid = has_no_tiny_digits();
        } else {
            for (Vec& p : points) p = on_grid(divided(p - middle));
        }
        sort();
    }

    // Over the unit.
    Vec divided(const Vec& a) const { return {a.x / unit, a.y / unit, a.z / unit}; }

    // Length within which points are coplanar, in units.
    double length(double coplanar_tolerance, double precision) const {
        return coplanar_tolerance * (reach_ / unit) + 4.0 * precision * (magnitude_ / unit);
    }

    std::vector<Vec> points;
    std::vector<int> number;  // in which row a point was given
    double unit;              // the given length that is 1 here
    bool valid;               // finite and not all in one place, and of digits that products keep

private:
    // Numbers from 2 to 4 have no finer digits.
    static Vec on_grid(const Vec& p) {
        return {(p.x + 3.0) - 3.0, (p.y + 3.0) - 3.0, (p.z + 3.0) - 3.0};
    }

    // By whole steps that are large beside the digits of most points, if that is exact.
    void move_near(const Vec& middle) {
        int size;
        std::frexp(reach_, &size);
        const double grid = std::ldexp(1.0, size - 8);
        const auto rounded = [grid](double x) { return std::nearbyint(x / grid) * grid; };
        const Vec shift{rounded(middle.x), rounded(middle.y), rounded(middle.z)};
        const auto stays_exact = [&shift](const Vec& p) {
            return exact_sum(p.x, -shift.x).low == 0.0 && exact_sum(p.y, -shift.y).low == 0.0 &&
                   exact_sum(p.z, -shift.z).low == 0.0;
        };
        if (!std::all_of(points.begin(), points.end(), stays_exact)) return;
        for (Vec& p : points) p = p - shift;
    }

    void shrink() {
        int exponent;
        std::frexp(Bounds(points.data(), points.size()).magnitude(), &exponent);
        unit = std::ldexp(1.0, exponent);
        const PowerOfTwo shrink(-exponent);
        for (Vec& p : points) p = shrink(p);
    }

    // Products of three differences must not underflow.
    bool has_no_tiny_digits() const {
        const auto is_tiny = [](double x) { return x != 0.0 && std::fabs(x) < 0x1p-288; };
        return std::none_of(points.begin(), points.end(), [&](const Vec& p) {
            return is_tiny(p.x) || is_tiny(p.y) || is_tiny(p.z);
        });
    }

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

    double reach_, magnitude_;  // half the extent, and the largest coordinate, as given
};

bool has_edge_within(const HalfEdges& edges, const Vec* given, const PlacedPoints& placed,
                     double distance) {
    for (std::size_t h = 0; h < edges.tail.size(); ++h) {
        if (edges.twin[h] < static_cast<Index>(h)) continue;
        const Vec& tail = given[edges.source[edges.tail[h]]];
        const Vec& head = given[edges.source[edges.tail[edges.twin[h]]]];
        if (norm(placed.divided(head - tail)) <= distance) return true;
    }
    return false;
}

std::vector<Vec> corners(const Vec* points, const std::vector<Index>& source) {
    std::vector<Vec> found;
    found.reserve(source.size());
    for (const Index i : source) found.push_back(points[i]);
    return found;
}

}  // namespace

MeasuredHull::MeasuredHull(const Vec* points, HalfEdges&& half_edges,
                           const MeasureTolerances& tolerances)
    : edges(std::move(half_edges)), vertices(corners(points, edges.source)),
      measures(polyhedron(), tolerances) {}

Polyhedron MeasuredHull::polyhedron() const {
    return {vertices.data(),
            static_cast<Index>(vertices.size()),
            edges.facet_start.data(),
            static_cast<Index>(edges.facet_start.size()) - 1,
            edges.tail.data(),
            edges.twin.data()};
}

MadeHull::MadeHull(const Vec* points, HalfEdges&& half_edges, const MeasureTolerances& tolerances)
    : MeasuredHull(points, std::move(half_edges), tolerances), connectivity(polyhedron()) {}

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
    if (count < 4 || count > MOST_POINTS) return std::nullopt;
    const PlacedPoints placed(points, count, false);
    if (!placed.valid) return std::nullopt;
    const double tolerance = placed.length(coplanar_tolerance, precision);
    const std::optional<Triangles> triangles = quickhull(placed.points, placed.number, tolerance);
    if (!triangles) return std::nullopt;
    std::optional<HalfEdges> edges = facet_loops(
        placed.number, *triangles, facet_labels(placed.points, *triangles, tolerance));
    if (!edges || has_edge_within(*edges, points, placed, tolerance)) return std::nullopt;
    return MadeHull(points, std::move(*edges), tolerances);
}

std::optional<ExactHull> make_exact_hull(const Vec* points, std::size_t count,
                                         double coplanar_tolerance, double precision,
                                         const MeasureTolerances& tolerances) {
    if (count < 4 || count > MOST_POINTS) return std::nullopt;
    const PlacedPoints placed(points, count, true);
    if (!placed.valid) return std::nullopt;
    std::optional<Triangles> triangles = quickhull(placed.points, placed.number, 0.0);
    if (!triangles) return std::nullopt;
    const FacetLabels flat = flat_labels(placed.points, *triangles);
    std::optional<HalfEdges> edges = facet_loops(placed.number, *triangles, flat);
    if (!edges) return std::nullopt;
    std::optional<HalfEdges> merged;
    std::vector<Index> merged_facet;
    if (coplanar_tolerance > 0.0) {
        const double tolerance = placed.length(coplanar_tolerance, precision);
        const FacetLabels facets = facet_labels(placed.points, *triangles, tolerance);
        if (facets.facets < flat.facets) merged = facet_loops(placed.number, *triangles, facets);
        if (merged) {
            merged_facet.resize(flat.facets);
            for (std::size_t t = triangles->size(); t-- > 0;)
                merged_facet[edges->facet_of_label[flat.label[t]]] =
                    merged->facet_of_label[facets.label[t]];
        }
    }
    triangles.reset();
    ExactHull found{MadeHull(points, std::move(*edges), tolerances), std::nullopt,
                    std::move(merged_facet)};
    if (merged) found.merged.emplace(points, std::move(*merged), tolerances);
    return found;
}

}  // namespace dicedesign
