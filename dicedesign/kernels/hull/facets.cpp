#include "hull/facets.hpp"

#include <limits>

namespace dicedesign {
namespace {

// A facet's side as it is seen from the center.
struct Side {
    Vec radius, edge, across;
    double length, reach;

    Side(const Vec& tail, const Vec& head, const Vec& normal, const Vec& center)
        : radius(tail - center),
          edge(head - tail),
          across(cross(edge, normal)),
          length(norm(edge)),
          reach(dot(radius, across) / length) {}
};

Index following(const Polyhedron& hull, Index facet, Index place) {
    return hull.tail[place + 1 < hull.facet_start[facet + 1] ? place + 1 : hull.facet_start[facet]];
}

double nearest_side(const Polyhedron& hull, Index facet, const Vec& normal, const Vec& center) {
    const Vec* const vertices = hull.vertices;
    double nearest = std::numeric_limits<double>::infinity();
    for (Index i = hull.facet_start[facet]; i < hull.facet_start[facet + 1]; ++i) {
        const Vec& head = vertices[following(hull, facet, i)];
        nearest = std::fmin(nearest, Side(vertices[hull.tail[i]], head, normal, center).reach);
    }
    return nearest;
}

double circumscribed(const Polyhedron& hull, const Vec& center) {
    double farthest = 0.0;
    for (Index i = 0; i < hull.vertex_count; ++i) {
        farthest = std::fmax(farthest, norm(hull.vertices[i] - center));
    }
    return farthest;
}

}  // namespace

Vec area_vector(const Polyhedron& hull, Index facet) {
    const Vec* const vertices = hull.vertices;
    const Vec& anchor = vertices[hull.tail[hull.facet_start[facet]]];
    Vec total{0.0, 0.0, 0.0};
    Vec a = vertices[hull.tail[hull.facet_start[facet] + 1]] - anchor;
    for (Index i = hull.facet_start[facet] + 2; i < hull.facet_start[facet + 1]; ++i) {
        const Vec b = vertices[hull.tail[i]] - anchor;
        total = total + cross(a, b);
        a = b;
    }
    return total;
}

void pull_back_area_vector(const Polyhedron& hull, Index facet, const Vec& gradient,
                           Vec* by_vertices) {
    const Vec* const vertices = hull.vertices;
    Index before = hull.tail[hull.facet_start[facet + 1] - 1];
    for (Index i = hull.facet_start[facet]; i < hull.facet_start[facet + 1]; ++i) {
        Vec& to = by_vertices[hull.tail[i]];
        const Vec across = vertices[following(hull, facet, i)] - vertices[before];
        to = to + cross(across, gradient);
        before = hull.tail[i];
    }
}

void pull_back_corners(const Vec* normals, const Vec* polar, const Index* planes,
                       const Vec* corners, Index corner_count, Index plane_count,
                       const Vec* gradients, Vec* by_normals, double* by_logarithms) {
    std::vector<Vec> by_polar(static_cast<std::size_t>(plane_count), Vec{0.0, 0.0, 0.0});
    for (Index t = 0; t < corner_count; ++t) {
        const Index* plane = planes + 3 * t;
        const Vec &a = polar[plane[0]], &b = polar[plane[1]], &c = polar[plane[2]];
        // The corner solves a . x = b . x = c . x = 1; so does its move for a moved plane.
        const Vec across[3] = {cross(b, c), cross(c, a), cross(a, b)};
        const double scale = -1.0 / dot(a, across[0]);
        for (int k = 0; k < 3; ++k) {
            Vec& to = by_polar[plane[k]];
            to = to + (scale * dot(across[k], gradients[t])) * corners[t];
        }
    }
    for (Index f = 0; f < plane_count; ++f) {
        const double length = norm(normals[f]);
        const Vec unit = (1.0 / length) * normals[f];
        const double along = dot(unit, by_polar[f]), size = norm(polar[f]);
        by_normals[f] = by_normals[f] + (size / length) * (by_polar[f] - along * unit);
        by_logarithms[f] -= size * along;
    }
}

std::vector<double> facet_depths(const Polyhedron& hull, const Vec& center) {
    const double scale = 1.0 / circumscribed(hull, center);
    std::vector<double> depths(static_cast<std::size_t>(hull.facet_count));
    for (Index f = 0; f < hull.facet_count; ++f) {
        const Direction normal(area_vector(hull, f));
        depths[f] = scale * nearest_side(hull, f, normal.unit, center);
    }
    return depths;
}

void pull_back_depths(const Polyhedron& hull, const Vec& center, const double* weights,
                      Vec* by_vertices, Vec& by_center) {
    const Vec* const vertices = hull.vertices;
    const double size = circumscribed(hull, center), scale = 1.0 / size;
    double by_size = 0.0;
    for (Index f = 0; f < hull.facet_count; ++f) {
        if (weights[f] == 0.0) continue;
        const Direction normal(area_vector(hull, f));
        const double nearest = nearest_side(hull, f, normal.unit, center);
        by_size -= weights[f] * nearest * scale * scale;
        std::vector<Index> touched;
        for (Index i = hull.facet_start[f]; i < hull.facet_start[f + 1]; ++i) {
            const Vec &tail = vertices[hull.tail[i]], &head = vertices[following(hull, f, i)];
            if (Side(tail, head, normal.unit, center).reach == nearest) touched.push_back(i);
        }
        const double weight = weights[f] * scale / static_cast<double>(touched.size());
        for (const Index i : touched) {
            const Index p = hull.tail[i], q = following(hull, f, i);
            const Side side(vertices[p], vertices[q], normal.unit, center);
            const double part = weight / side.length;
            // Of radius . (edge x normal) / length.
            const Vec by_radius = part * side.across;
            const Vec by_edge = part * (cross(normal.unit, side.radius) -
                                        (side.reach / side.length) * side.edge);
            const Vec by_normal = part * cross(side.radius, side.edge);
            by_vertices[p] = by_vertices[p] + by_radius - by_edge;
            by_vertices[q] = by_vertices[q] + by_edge;
            by_center = by_center - by_radius;
            pull_back_area_vector(hull, f, normal.pull_back(by_normal), by_vertices);
        }
    }
    std::vector<Index> farthest;
    for (Index i = 0; i < hull.vertex_count; ++i) {
        if (norm(vertices[i] - center) == size) farthest.push_back(i);
    }
    for (const Index i : farthest) {
        const Vec gradient =
            (by_size * scale / static_cast<double>(farthest.size())) * (vertices[i] - center);
        by_vertices[i] = by_vertices[i] + gradient;
        by_center = by_center - gradient;
    }
}

}  // namespace dicedesign
