#include "gradient/adjoint.hpp"

#include <vector>

namespace dicedesign {
namespace {

// The area on the right of an arc of a border, per move of either of its ends: the arc sweeps it.
// What its ends share with the reference direction cancels around a basin and is left out.
inline Vec swept(const Vec& a, const Vec& b) { return (1.0 / (1.0 + dot(a, b))) * cross(a, b); }

// Give `sink(vertex, gradient)` the derivatives, in r = vertex - center, of the area on the left
// of a branch, and `edge(p, q, gradient)` those in the edge vector q - p.
template <class Radius, class Edge>
void sweep(const Paths& paths, Index branch, const Vec* vertices, const Vec& center,
           std::vector<Vec>& points, const Radius& radius, const Edge& edge) {
    points.clear();
    branch_points(paths, branch, vertices, center, points);
    const Index first = paths.branch_start[branch];
    std::size_t i = points.size() - 1;
    const Index peak = paths.maxima[branch];
    Vec gradient = -swept(points[i - 1], points[i]);
    radius(peak, (1.0 / norm(vertices[peak] - center)) * gradient);
    // `gradient` is that in point i of the arc that leaves it and of all that follows.
    for (--i; i > 0; --i) {
        gradient = gradient - swept(points[i - 1], points[i]);
        const Index* crossed = paths.crossings + 2 * (first + static_cast<Index>(i) - 1);
        const Vec& u = points[i - 1];
        const Vec r = vertices[crossed[0]] - center;
        const Vec v = vertices[crossed[1]] - vertices[crossed[0]];
        const double growth = dot(r, v), slant = dot(u, v);
        const double size = norm(oblique_projection(u, r, v));
        if (size > 0.0) {
            const Vec moved = before_scaling(gradient, points[i], size);
            const double by_u = dot(u, moved), by_r = dot(r, moved);
            radius(crossed[0], by_u * v - slant * moved);
            edge(crossed[0], crossed[1], by_u * r - by_r * u);
            gradient = growth * moved - by_r * v;
        }
        gradient = gradient - swept(u, points[i]);
    }
    const Index* ends = paths.saddle_ends + 2 * (branch / 2);
    const Vec a = vertices[ends[0]] - center, b = vertices[ends[1]] - center;
    const bool tail_is_nearer = dot(a, a) <= dot(b, b);
    const Vec& r = tail_is_nearer ? a : b;
    const Vec v = vertices[ends[1]] - vertices[ends[0]];
    const double square = dot(v, v), along = dot(r, v);
    const Vec foot = before_scaling(gradient, points[0], norm(oblique_projection(r, v, v)));
    radius(ends[tail_is_nearer ? 0 : 1], square * foot - dot(v, foot) * v);
    edge(ends[0], ends[1], (2.0 * dot(r, foot)) * v - along * foot - dot(v, foot) * r);
}

}  // namespace

void pull_back_areas(const Paths& paths, const Vec* vertices, const Vec& center,
                     const double* weights, Vec* by_vertices, Vec& by_center) {
    std::vector<Vec> points;
    for (Index branch = 0; branch < 2 * paths.saddles; ++branch) {
        const Index* basins = paths.basins + 2 * (branch / 2);
        // What one basin gains the other loses.
        const double weight = weights[basins[branch % 2]] - weights[basins[1 - branch % 2]];
        if (weight == 0.0) continue;
        const auto radius = [&](Index vertex, const Vec& gradient) {
            by_vertices[vertex] += weight * gradient;
            by_center += -weight * gradient;
        };
        const auto edge = [&](Index tail, Index head, const Vec& gradient) {
            by_vertices[head] += weight * gradient;
            by_vertices[tail] += -weight * gradient;
        };
        sweep(paths, branch, vertices, center, points, radius, edge);
    }
}

void area_jacobian(const Paths& paths, const Vec* vertices, Index count, const Vec& center,
                   Vec* by_vertices, Vec* by_center) {
    std::vector<Vec> points;
    for (Index branch = 0; branch < 2 * paths.saddles; ++branch) {
        const Index* basins = paths.basins + 2 * (branch / 2);
        const Index gains = basins[branch % 2], loses = basins[1 - branch % 2];
        Vec *gaining = by_vertices + gains * count, *losing = by_vertices + loses * count;
        const auto radius = [&](Index vertex, const Vec& gradient) {
            gaining[vertex] += gradient;
            losing[vertex] += -gradient;
            by_center[gains] += -gradient;
            by_center[loses] += gradient;
        };
        const auto edge = [&](Index tail, Index head, const Vec& gradient) {
            gaining[head] += gradient;
            gaining[tail] += -gradient;
            losing[head] += -gradient;
            losing[tail] += gradient;
        };
        sweep(paths, branch, vertices, center, points, radius, edge);
    }
}

bool pull_back_centroid(const Polyhedron& hull, const Vec& gradient, double thin_volume,
                        Vec* by_vertices) {
    const Vec* const vertices = hull.vertices;
    const Index count = hull.vertex_count;
    Vec middle{0.0, 0.0, 0.0};
    for (Index i = 0; i < count; ++i) middle += vertices[i];
    middle = (1.0 / static_cast<double>(count)) * middle;
    double reach = 0.0;
    for (Index i = 0; i < count; ++i) {
        reach = std::fmax(reach, largest(absolute(vertices[i] - middle)));
    }
    // Tetrahedra from the middle to the triangles of the facets' fans.
    const auto each_triangle = [&](const auto& work) {
        for (Index f = 0; f < hull.facet_count; ++f) {
            const Index* tail = hull.tail + hull.facet_start[f];
            const Index corners = hull.facet_start[f + 1] - hull.facet_start[f];
            for (Index i = 2; i < corners; ++i) work(tail[0], tail[i - 1], tail[i]);
        }
    };
    double sixfold = 0.0;
    Vec moment{0.0, 0.0, 0.0};
    each_triangle([&](Index i, Index j, Index k) {
        const Vec a = vertices[i] - middle, b = vertices[j] - middle, c = vertices[k] - middle;
        const double part = dot(a, cross(b, c));
        sixfold += part;
        moment += part * (a + b + c);
    });
    if (!(sixfold / 6.0 >= thin_volume * reach * reach * reach)) return false;
    const double along = dot(gradient, moment) / (4.0 * sixfold);
    each_triangle([&](Index i, Index j, Index k) {
        const Vec a = vertices[i] - middle, b = vertices[j] - middle, c = vertices[k] - middle;
        const Vec bc = cross(b, c);
        const double by_volume = (0.25 * dot(gradient, a + b + c) - along) / sixfold;
        const Vec shared = (0.25 * dot(a, bc) / sixfold) * gradient;
        by_vertices[i] += by_volume * bc + shared;
        by_vertices[j] += by_volume * cross(c, a) + shared;
        by_vertices[k] += by_volume * cross(a, b) + shared;
    });
    return true;
}

}  // namespace dicedesign
