#include "hull/check.hpp"

#include <algorithm>
#include <limits>

namespace dicedesign {
namespace {

double determinant(const Vec& a, const Vec& b, const Vec& c) { return dot(a, cross(b, c)); }

// Lengths are measured in units of half the extent of all points.
class HullCheck {
public:
    HullCheck(const Polyhedron& hull, const Measures& measures, const ReuseTolerances& tolerances)
        : hull_(hull), measures_(measures), tolerances_(tolerances),
          position_(hull.vertices, hull.vertices + hull.vertex_count),
          facet_of_(hull.half_edge_count()) {
        for (Index f = 0; f < hull.facet_count; ++f)
            std::fill(facet_of_.begin() + hull.facet_start[f],
                      facet_of_.begin() + hull.facet_start[f + 1], f);
    }

    bool run(const std::vector<Vec>& others) {
        if (!measures_.has_normals || !find_scale(others)) return false;
        move_to_middle();
        for (Index f = 0; f < hull_.facet_count; ++f)
            if (!is_flat_and_turns(f) || !is_clear_of_neighbors(f)) return false;
        return surrounds_once() && contains(others);
    }

private:
    bool find_scale(const std::vector<Vec>& others) {
        Box box(position_[0]);
        bool finite = true;
        const auto widen = [&](const Vec& p) {
            finite = finite && sum(absolute(p)) < std::numeric_limits<double>::infinity();
            box.add(p);
        };
        for (const Vec& p : position_) widen(p);
        for (const Vec& p : others) widen(p);
        scale_ = 0.5 * box.extent();
        return finite && box.magnitude() <= tolerances_.offset * scale_;
    }

    void move_to_middle() {
        Vec middle{0.0, 0.0, 0.0};
        for (const Vec& p : position_) middle = middle + p;
        middle = (1.0 / static_cast<double>(position_.size())) * middle;
        for (Vec& p : position_) p = (1.0 / scale_) * (p - middle);
    }

    const Vec& start(Index h) const { return position_[hull_.tail[h]]; }

    // How far the corners beside an edge's other side lie below a facet's plane, the nearer one.
    double depth_of_neighbor(const Vec& normal, double level, Index h) const {
        const Index twin = hull_.twin[h];
        const Index f = facet_of_[twin];
        const Index first = hull_.facet_start[f], end = hull_.facet_start[f + 1];
        const Index before = twin == first ? end - 1 : twin - 1;
        const Index after = twin + 1 == end ? first : twin + 1;
        const Index behind = after + 1 == end ? first : after + 1;
        return level - larger(dot(normal, start(before)), dot(normal, start(behind)));
    }

    // Corners on one plane, all of them convex, once around.
    bool is_flat_and_turns(Index f) {
        const Index first = hull_.facet_start[f], end = hull_.facet_start[f + 1];
        const Vec& normal = measures_.normals[f];
        const double level = dot(normal, start(first));
        if (!(level >= tolerances_.margin)) return false;
        const bool is_triangle = end - first == 3;
        const double slope = std::tan(tolerances_.turn);
        double turned = 0.0;
        for (Index h = first; h < end; ++h) {
            const Index after = h + 1 == end ? first : h + 1;
            const Index beyond = after + 1 == end ? first : after + 1;
            if (!(std::fabs(dot(normal, start(h)) - level) <= tolerances_.flatness)) return false;
            const Vec edge = start(after) - start(h), next = start(beyond) - start(after);
            const double sine = determinant(normal, edge, next), cosine = dot(edge, next);
            if (!(sine > 0.0 && sine >= slope * cosine)) return false;
            // A triangle has no way to turn twice.
            if (!is_triangle) turned += std::atan2(sine, cosine);
        }
        return turned <= 3.0 * PI;
    }

    // In a convex polygon, the corner nearest to an edge's line is one beside the edge. No edge is
    // shorter than the smallest depth: its end is that near to the edge beside it.
    bool is_clear_of_neighbors(Index f) {
        const Index first = hull_.facet_start[f], end = hull_.facet_start[f + 1];
        const Vec& normal = measures_.normals[f];
        const double level = dot(normal, start(first));
        const double share =
            measures_.areas[f] / (static_cast<double>(end - first) * scale_ * scale_);
        for (Index h = first; h < end; ++h) {
            const double depth = depth_of_neighbor(normal, level, h);
            const double length = norm(start(h + 1 == end ? first : h + 1) - start(h));
            if (!(depth >= tolerances_.margin)) return false;
            if (!(depth * smaller(length, share) >= tolerances_.leverage)) return false;
        }
        return true;
    }

    // A surface that winds around its middle twice is met twice by a ray from there.
    bool surrounds_once() const {
        Vec ray{0.0, 0.0, 0.0};
        for (Index h = 0; h < hull_.facet_start[1]; ++h) ray = ray + start(h);
        ray = (1.0 / static_cast<double>(hull_.facet_start[1])) * ray;
        int met = 0;
        for (Index f = 0; f < hull_.facet_count; ++f) {
            const Index first = hull_.facet_start[f], end = hull_.facet_start[f + 1];
            bool is_met = true;
            for (Index h = first; h < end && is_met; ++h)
                is_met = determinant(start(h), start(h + 1 == end ? first : h + 1), ray) >=
                         -tolerances_.flatness;
            met += is_met;
        }
        return met == 1;
    }

    bool contains(const std::vector<Vec>& others) const {
        for (Index f = 0; f < hull_.facet_count && !others.empty(); ++f) {
            const Vec& normal = measures_.normals[f];
            const double level = dot(normal, hull_.vertices[hull_.tail[hull_.facet_start[f]]]);
            for (const Vec& p : others)
                if (!(dot(normal, p) - level <= -tolerances_.margin * scale_)) return false;
        }
        return true;
    }

    const Polyhedron& hull_;
    const Measures& measures_;
    const ReuseTolerances& tolerances_;
    std::vector<Vec> position_;
    std::vector<Index> facet_of_;
    double scale_ = 0.0;
};

}  // namespace

bool is_convex(const Polyhedron& hull, const Measures& measures, const std::vector<Vec>& others,
               const ReuseTolerances& tolerances) {
    return HullCheck(hull, measures, tolerances).run(others);
}

}  // namespace dicedesign
