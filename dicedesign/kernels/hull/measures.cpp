#include "hull/measures.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "hull/bounds.hpp"
#include "hull/triangulation.hpp"
#include "twofold.hpp"

namespace dicedesign {
namespace {

// Sums of many numbers in blocks: errors grow with the size and with the number of blocks.
template <class T>
class BlockSum {
public:
    void add(const T& term) {
        block_ = block_ + term;
        if (++size_ < 128) return;
        total_ = total_ + block_;
        block_ = T{};
        size_ = 0;
    }

    T total() const { return total_ + block_; }

private:
    T total_{}, block_{};
    int size_ = 0;
};

// Volume and centroid of a solid, over the tetrahedra from a point inside to its surface.
class TetrahedronSum {
public:
    explicit TetrahedronSum(const Vec& middle) : middle_(middle) {}

    void add(const Vec& a, const Vec& b, const Vec& c) {
        const Vec u = a - middle_, v = b - middle_, w = c - middle_;
        const double volume = dot(u, cross(v, w));
        volumes_.add(volume);
        moments_.add(volume * (u + v + w));
    }

    double volume() const { return volumes_.total() / 6.0; }
    Vec centroid() const { return middle_ + (1.0 / (4.0 * volumes_.total())) * moments_.total(); }

private:
    Vec middle_;
    BlockSum<double> volumes_;
    BlockSum<Vec> moments_;
};

// Part of the square over its longest edge above which a facet has all digits of its normal when
// its area is computed in twofold numbers.
constexpr double TWOFOLD_SLIVER = 0x1p-46;

// Normal of a facet, times twice its area, computed in twofold numbers and rounded once.
Vec sliver_area_vector(const Polyhedron& hull, const std::vector<Vec>& points, Index facet) {
    const Index first = hull.facet_start[facet], end = hull.facet_start[facet + 1];
    const Vec& anchor = points[hull.tail[first]];
    const auto arm = [&](Index h) {
        const Vec& corner = points[hull.tail[h]];
        return Vector<Twofold>{exact_sum(corner.x, -anchor.x), exact_sum(corner.y, -anchor.y),
                               exact_sum(corner.z, -anchor.z)};
    };
    Vector<Twofold> total{0.0, 0.0, 0.0};
    for (Index h = first + 1; h + 1 < end; ++h) total = total + cross(arm(h), arm(h + 1));
    return {total.x.high, total.y.high, total.z.high};
}

}  // namespace

Connectivity::Connectivity(const Polyhedron& hull)
    : facet(hull.half_edge_count()), next(facet.size()), previous(facet.size()),
      head(facet.size()), outgoing_start(hull.vertex_count + 1), outgoing(facet.size()) {
    for (Index f = 0; f < hull.facet_count; ++f) {
        const Index first = hull.facet_start[f], end = hull.facet_start[f + 1];
        for (Index h = first; h < end; ++h) {
            facet[h] = f;
            next[h] = h + 1 == end ? first : h + 1;
            previous[h] = h == first ? end - 1 : h - 1;
            head[h] = hull.tail[next[h]];
        }
    }
    for (std::size_t h = 0; h < facet.size(); ++h) ++outgoing_start[hull.tail[h] + 1];
    std::partial_sum(outgoing_start.begin(), outgoing_start.end(), outgoing_start.begin());
    std::vector<Index> filled(outgoing_start.begin(), outgoing_start.end() - 1);
    for (std::size_t h = 0; h < facet.size(); ++h)
        outgoing[filled[hull.tail[h]]++] = static_cast<Index>(h);
}

Measures::Measures(const Polyhedron& hull, const MeasureTolerances& tolerances) {
    double size = 0.0;
    for (Index v = 0; v < hull.vertex_count; ++v)
        size = larger(size, largest(absolute(hull.vertices[v])));
    int exponent;
    std::frexp(size, &exponent);
    // A power of two that scales the largest coordinate to about 1, so that products of coordinates
    // do not overflow for a body of any size.
    std::vector<Vec> points(hull.vertices, hull.vertices + hull.vertex_count);
    const PowerOfTwo shrink(-exponent), grow(exponent), grow_area(2 * exponent);
    for (Vec& point : points) point = shrink(point);

    Box box(points[0]);
    BlockSum<Vec> total;
    for (const Vec& p : points) {
        box.add(p);
        total.add(p);
    }
    const Vec middle = (1.0 / static_cast<double>(points.size())) * total.total();
    normals.resize(hull.facet_count);
    areas.resize(hull.facet_count);
    has_normals = true;
    TetrahedronSum solid(middle);
    for (Index f = 0; f < hull.facet_count; ++f) {
        const Index first = hull.facet_start[f], end = hull.facet_start[f + 1];
        has_normals = measure_facet(hull, points, f, tolerances.sliver) && has_normals;
        for (Index h = first + 1; h + 1 < end; ++h)
            solid.add(points[hull.tail[first]], points[hull.tail[h]], points[hull.tail[h + 1]]);
    }
    is_flat = unevenness <= tolerances.rounding * box.extent();
    unevenness = grow(unevenness);
    for (double& area : areas) area = grow_area(area);

    const double reach = box.reach(middle);
    has_centroid = std::fabs(solid.volume()) >= tolerances.thin_volume * reach * reach * reach;
    if (has_centroid) centroid = grow(solid.centroid());
}

// Whether a facet is no sliver; its measures if so.
bool Measures::measure_facet(const Polyhedron& hull, const std::vector<Vec>& points,
                             Index facet, double sliver) {
    const Index first = hull.facet_start[facet], end = hull.facet_start[facet + 1];
    const Vec& anchor = points[hull.tail[first]];
    Vec doubled{0.0, 0.0, 0.0};
    double longest = 0.0;
    for (Index h = first; h < end; ++h) {
        const Vec& corner = points[hull.tail[h]];
        const Vec& after = points[hull.tail[h + 1 == end ? first : h + 1]];
        const Vec edge = after - corner;
        longest = larger(longest, dot(edge, edge));
        if (h != first && h + 1 != end)
            doubled = doubled + doubled_area_vector(anchor, corner, after);
    }
    double size = norm(doubled);
    if (!(size > sliver * longest)) {
        doubled = sliver_area_vector(hull, points, facet);
        size = norm(doubled);
        if (!(size > TWOFOLD_SLIVER * longest)) return false;
    }
    const Vec normal{doubled.x / size, doubled.y / size, doubled.z / size};
    double lowest = 0.0, highest = 0.0;
    for (Index h = first + 1; h < end; ++h) {
        const double height = dot(points[hull.tail[h]] - anchor, normal);
        lowest = smaller(lowest, height);
        highest = larger(highest, height);
    }
    unevenness = larger(unevenness, highest - lowest);
    normals[facet] = normal;
    areas[facet] = 0.5 * size;
    return true;
}

}  // namespace dicedesign
