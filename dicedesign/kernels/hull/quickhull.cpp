// Quickhull with exact decisions.
//
// A facet keeps the points above it that no other facet keeps. The farthest of them is added, the
// facets that it sees are removed, and their points go to the new facets around it. A point in
// the plane of a facet does not see it: then no new triangle is degenerate, as its point does not
// lie in the plane of the facet that was removed beside it, and large flat facets cost no more
// than others. A plane decides if its error bound allows, else exact arithmetic.
// Source: Barber, Dobkin and Huhdanpaa, "The Quickhull Algorithm for Convex Hulls", ACM Trans.
// Math. Softw. 22, 1996.
#include "hull/quickhull.hpp"

#include <algorithm>
#include <limits>

#include "hull/orientation.hpp"
#include "hull/simplex.hpp"

namespace dicedesign {
namespace {

// Bound on the rounding error of a height above a plane, relative to the square of the longest side
// of its triangle along the axes, heights being multiplied by its doubled area: 100 units suffice
// for coordinates up to 1.
constexpr double PLANE_ROUNDING = 128.0 * 0x1p-53;

// A facet that keeps more points than this waits for its turn.
constexpr int CROWD = 256;

struct Plane {
    Vec normal;
    double offset;
    double bound;

    double height(const Vec& q) const { return dot(normal, q) - offset; }
};

struct Facet : Triangle {
    Plane plane;
    int outside = NONE;   // first of the points that it keeps
    int farthest = NONE;  // the highest of them
    int kept = 0;         // number of them
    double height = -std::numeric_limits<double>::infinity();
    int round = NONE;     // when a new point was last compared with it
    bool seen = false;    // whether that point sees it
};

// An edge at which the surface that a point sees ends, and the facet behind it.
struct Rim {
    int tail, head;
    int facet, edge;
};

class Quickhull {
public:
    Quickhull(const std::vector<Vec>& points, const std::vector<int>& number, double near)
        : points_(points), number_(number), near_(near), following_(points.size()),
          made_(points.size(), NONE), made_round_(points.size(), NONE) {}

    std::optional<Triangles> run() {
        if (!start()) return std::nullopt;
        // Facets that keep many points take turns, so that the hull grows evenly: if one side were
        // finished first, every point of another side would see most of it. Of the other facets
        // the newest comes first, as its points are near those processed last.
        for (std::size_t next = 0; next < crowded_.size() || !pending_.empty();) {
            const bool late = next == crowded_.size();
            const int facet = late ? pending_.back() : crowded_[next];
            if (late) {
                pending_.pop_back();
            } else {
                ++next;
            }
            if (!finish(facet)) return std::nullopt;
        }
        return triangles();
    }

private:
    Plane plane(int a, int b, int c) const {
        const Vec u = points_[b] - points_[a], v = points_[c] - points_[a];
        const Vec normal = cross(u, v);
        const double longest = larger(largest(absolute(u)), largest(absolute(v)));
        return {normal, dot(normal, points_[a]), PLANE_ROUNDING * longest * longest};
    }

    // Whether a point is above the triangle of a plane, at the height that was computed.
    bool above(const Plane& plane, double height, int a, int b, int c, int q) const {
        if (height > plane.bound) return true;
        if (height < -plane.bound) return false;
        return exact_side(points_[a], points_[b], points_[c], points_[q]) > 0;
    }

    // Of points at one place the first stands for all; false where a point that is left out is only
    // near to a corner of higher number.
    bool leave_out(int point, int corner) {
        const double distance = largest(absolute(points_[point] - points_[corner]));
        if (distance > near_ || number_[point] > number_[corner]) return true;
        if (distance == 0.0) repeated_.push_back({corner, point});
        return distance == 0.0;
    }

    void keep(int facet, int point, double height) {
        Facet& f = facets_[facet];
        following_[point] = f.outside;
        f.outside = point;
        ++f.kept;
        if (height > f.height || f.farthest == NONE) {
            f.height = height;
            f.farthest = point;
        }
    }

    bool start() {
        const std::optional<Simplex> corner = wide_simplex(points_);
        if (!corner) return false;
        build(*corner);
        return share_out(*corner);
    }

    void build(const Simplex& corner) {
        constexpr int OPPOSITE[4][3] = {{1, 3, 2}, {0, 2, 3}, {0, 3, 1}, {0, 1, 2}};
        facets_.resize(4);
        facets_.reserve(4 + 3 * std::min<std::size_t>(points_.size(), 1000));
        for (int i = 0; i < 4; ++i) {
            Facet& f = facets_[i];
            for (int k = 0; k < 3; ++k) {
                f.corner[k] = corner[OPPOSITE[i][k]];
                f.neighbor[k] = OPPOSITE[i][k];
            }
            f.plane = plane(f.corner[0], f.corner[1], f.corner[2]);
        }
    }

    bool share_out(const Simplex& corner) {
        const int count = static_cast<int>(points_.size());
        const Plane planes[4] = {facets_[0].plane, facets_[1].plane, facets_[2].plane,
                                 facets_[3].plane};
        for (int q = 0; q < count; ++q) {
            double height = -std::numeric_limits<double>::infinity();
            int facet = 0;
            bool unsure = false;
            for (int i = 0; i < 4; ++i) {
                const double h = planes[i].height(points_[q]);
                if (h >= -planes[i].bound) unsure = true;
                if (h > height) {
                    height = h;
                    facet = i;
                }
            }
            if (!unsure) continue;
            if (height > planes[facet].bound) {
                keep(facet, q, height);
                continue;
            }
            if (q == corner[0] || q == corner[1] || q == corner[2] || q == corner[3]) continue;
            bool kept = false;
            for (int i = 0; i < 4 && !kept; ++i) {
                const Facet& f = facets_[i];
                const double h = f.plane.height(points_[q]);
                kept = above(f.plane, h, f.corner[0], f.corner[1], f.corner[2], q);
                if (kept) keep(i, q, h);
            }
            for (int i = 0; i < 4 && !kept; ++i)
                if (!leave_out(q, corner[i])) return false;
        }
        for (int i = 0; i < 4; ++i)
            await(i);
        return true;
    }

    // Puts a facet that keeps points among those to come.
    void await(int facet) {
        const Facet& f = facets_[facet];
        if (f.outside == NONE) return;
        (f.kept > CROWD ? crowded_ : pending_).push_back(facet);
    }

    bool finish(int facet) { return facets_[facet].outside == NONE || add(facet); }

    bool add(int start) {
        const int point = facets_[start].farthest;
        see(start, point);
        gather(point);
        return surround(point) && share_out(point);
    }

    // The facets that a point sees, beginning with one of them, and the edges around them.
    void see(int start, int point) {
        ++round_;
        visible_.clear();
        rim_.clear();
        visible_.push_back(start);
        facets_[start].round = round_;
        facets_[start].seen = true;
        for (std::size_t i = 0; i < visible_.size(); ++i) {
            const int f = visible_[i];
            for (int k = 0; k < 3; ++k) {
                const int other = facets_[f].neighbor[k];
                Facet& g = facets_[other];
                if (g.round != round_) {
                    g.round = round_;
                    g.seen = above(g.plane, g.plane.height(points_[point]), g.corner[0],
                                   g.corner[1], g.corner[2], point);
                    if (g.seen) visible_.push_back(other);
                }
                if (g.seen) continue;
                const int* corner = facets_[f].corner;
                rim_.push_back({corner[NEXT[k]], corner[LAST[k]], other, edge_to(g, f)});
            }
        }
    }

    // The points that the visible facets kept, but for the one that is put in.
    void gather(int point) {
        orphans_.clear();
        for (const int f : visible_) {
            for (int q = facets_[f].outside; q != NONE; q = following_[q])
                if (q != point) orphans_.push_back(q);
            facets_[f].corner[0] = NONE;
            facets_[f].outside = NONE;
            unused_.push_back(f);
        }
    }

    // New facets from the rim to a point; false where the rim is no loop.
    bool surround(int point) {
        fan_.clear();
        for (const Rim& rim : rim_) {
            int number = static_cast<int>(facets_.size());
            if (unused_.empty()) {
                facets_.emplace_back();
            } else {
                number = unused_.back();
                unused_.pop_back();
                facets_[number] = Facet{};
            }
            Facet& f = facets_[number];
            f.corner[0] = rim.tail;
            f.corner[1] = rim.head;
            f.corner[2] = point;
            f.neighbor[2] = rim.facet;
            f.plane = plane(rim.tail, rim.head, point);
            facets_[rim.facet].neighbor[rim.edge] = number;
            fan_.push_back({f.plane, number});
            if (made_round_[rim.tail] == round_) return false;
            made_round_[rim.tail] = round_;
            made_[rim.tail] = number;
        }
        for (const Spoke& spoke : fan_) {
            const int head = facets_[spoke.facet].corner[1];
            if (made_round_[head] != round_) return false;
            facets_[spoke.facet].neighbor[0] = made_[head];
            facets_[made_[head]].neighbor[1] = spoke.facet;
        }
        return true;
    }

    // The new facets keep what lies above them.
    bool share_out(int point) {
        for (const int q : orphans_) {
            bool kept = false;
            for (const Spoke& spoke : fan_) {
                const double height = spoke.plane.height(points_[q]);
                if (height < -spoke.plane.bound) continue;
                const int* corner = facets_[spoke.facet].corner;
                if (!above(spoke.plane, height, corner[0], corner[1], corner[2], q)) continue;
                keep(spoke.facet, q, height);
                kept = true;
                break;
            }
            if (!kept && !leave_out(q, point)) return false;
        }
        for (const Spoke& spoke : fan_)
            await(spoke.facet);
        return true;
    }

    Triangles triangles() {
        std::vector<int> number(facets_.size(), NONE);
        int count = 0;
        for (std::size_t f = 0; f < facets_.size(); ++f)
            if (facets_[f].corner[0] != NONE) number[f] = count++;
        Triangles found;
        found.reserve(count);
        for (const Facet& f : facets_) {
            if (f.corner[0] == NONE) continue;
            Triangle triangle = f;
            for (int& neighbor : triangle.neighbor) neighbor = number[neighbor];
            found.push_back(triangle);
        }
        if (repeated_.empty()) return found;
        std::vector<int> standing(points_.size(), NONE);
        for (const Repeated& pair : repeated_) {
            int& first = standing[pair.corner];
            if (first == NONE || number_[pair.point] < number_[first]) first = pair.point;
        }
        for (Triangle& triangle : found)
            for (int& corner : triangle.corner)
                if (standing[corner] != NONE) corner = standing[corner];
        return found;
    }

    struct Spoke {
        Plane plane;
        int facet;
    };

    struct Repeated {
        int corner, point;
    };

    const std::vector<Vec>& points_;
    const std::vector<int>& number_;
    const double near_;
    std::vector<Facet> facets_;
    std::vector<int> following_;  // next point that the facet of a point keeps
    std::vector<int> made_;       // the new facet whose rim starts at a point,
    std::vector<int> made_round_;  // and when it was made
    std::vector<int> crowded_, pending_;  // facets to come, in turn and the newest first
    std::vector<int> unused_, visible_, orphans_;
    std::vector<Rim> rim_;
    std::vector<Spoke> fan_;
    std::vector<Repeated> repeated_;
    int round_ = 0;
};

}  // namespace

std::optional<Triangles> quickhull(const std::vector<Vec>& points,
                                   const std::vector<int>& number, double near) {
    return Quickhull(points, number, near).run();
}

}  // namespace dicedesign
