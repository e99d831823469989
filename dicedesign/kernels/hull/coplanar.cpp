#include "hull/coplanar.hpp"

#include <algorithm>
#include <numeric>

#include "hull/orientation.hpp"

namespace dicedesign {
namespace {

class Labeling {
public:
    Labeling(const std::vector<Vec>& points, const Triangles& triangles, double tolerance)
        : points_(points), triangles_(triangles), tolerance_(tolerance),
          count_(static_cast<int>(triangles.size())), doubled_(count_), area_(count_),
          label_(count_) {
        for (int t = 0; t < count_; ++t) {
            const int* corner = triangles[t].corner;
            doubled_[t] = doubled_area_vector(points[corner[0]], points[corner[1]],
                                              points[corner[2]]);
            area_[t] = norm(doubled_[t]);
        }
    }

    FacetLabels run() {
        std::iota(label_.begin(), label_.end(), 0);
        bool merged = false;
        parent_ = label_;
        joined_.assign(3 * static_cast<std::size_t>(count_), false);
        for (int t = 0; t < count_; ++t)
            for (int k = 0; k < 3; ++k)
                if (is_flat(t, k)) {
                    join(t, k);
                    merged = true;
                }
        int facets = count_;
        while (merged) {
            facets = group();
            merged = join_missed();
        }
        return {std::move(label_), facets};
    }

private:
    // Whether all corners of a triangle are near the plane of another.
    bool is_near(int base, int other) const {
        const int* corner = triangles_[other].corner;
        return is_near_plane(base, corner[0]) && is_near_plane(base, corner[1]) &&
               is_near_plane(base, corner[2]);
    }

    bool is_near_plane(int base, int point) const {
        const Vec offset = points_[point] - points_[triangles_[base].corner[0]];
        return std::fabs(dot(offset, doubled_[base])) <= tolerance_ * area_[base];
    }

    // Measured from the larger of the two, from either where they are as large: a sliver has no
    // normal worth the name.
    bool is_flat(int t, int k) const {
        const Triangle& triangle = triangles_[t];
        const int other = triangle.neighbor[k];
        if (t > other) return false;
        const int base = area_[t] > area_[other] ? t : other;
        // Corners of the common edge are near; the third decides nearly always.
        const Triangle& smaller = triangles_[base == t ? other : t];
        if (area_[t] != area_[other] &&
            !is_near_plane(base, smaller.corner[edge_to(smaller, base)]))
            return false;
        return (area_[t] >= area_[other] && is_near(t, other)) ||
               (area_[other] >= area_[t] && is_near(other, t));
    }

    int root(int t) {
        while (parent_[t] != t) t = parent_[t] = parent_[parent_[t]];
        return t;
    }

    void join(int t, int k) {
        joined_[3 * static_cast<std::size_t>(t) + k] = true;
        parent_[root(t)] = root(triangles_[t].neighbor[k]);
    }

    // Labels of the joined triangles, numbered from 0. A chain of small bends is no facet: what is
    // far from the plane of the largest triangle of its group is split from it.
    int group() {
        for (int t = 0; t < count_; ++t) label_[t] = root(t);
        find_largest();
        std::vector<int> drifting;
        for (int t = 0; t < count_; ++t)
            if (!is_near(largest_[label_[t]], t)) drifting.push_back(label_[t]);
        std::sort(drifting.begin(), drifting.end());
        drifting.erase(std::unique(drifting.begin(), drifting.end()), drifting.end());
        if (!drifting.empty()) split(drifting);
        std::vector<int> number(label_.size(), NONE);
        int facets = 0;
        for (int& label : label_) {
            if (number[label] == NONE) number[label] = facets++;
            label = number[label];
        }
        find_largest();
        return facets;
    }

    void find_largest() {
        largest_.assign(count_, NONE);
        for (int t = 0; t < count_; ++t) {
            int& largest = largest_[label_[t]];
            if (largest == NONE || area_[t] >= area_[largest]) largest = t;
        }
    }

    // Groups become regions that are grown from their largest triangles outward; each has the
    // number of its first triangle, which was a root of no other.
    void split(const std::vector<int>& drifting) {
        std::vector<std::vector<int>> members(drifting.size());
        std::vector<int> label(label_);
        for (int t = 0; t < count_; ++t) {
            const auto found = std::lower_bound(drifting.begin(), drifting.end(), label_[t]);
            if (found == drifting.end() || *found != label_[t]) continue;
            members[found - drifting.begin()].push_back(t);
            label[t] = NONE;
        }
        for (std::vector<int>& group : members) {
            const int whole = label_[group[0]];
            std::stable_sort(group.begin(), group.end(),
                             [this](int s, int t) { return area_[s] > area_[t]; });
            for (const int seed : group)
                if (label[seed] == NONE) grow(seed, whole, label);
        }
        label_ = std::move(label);
    }

    void grow(int seed, int whole, std::vector<int>& label) const {
        label[seed] = seed;
        std::vector<int> front{seed};
        while (!front.empty()) {
            const Triangle& triangle = triangles_[front.back()];
            front.pop_back();
            for (const int other : triangle.neighbor) {
                if (label[other] != NONE || label_[other] != whole || !is_near(seed, other))
                    continue;
                label[other] = seed;
                front.push_back(other);
            }
        }
    }

    // A sliver among slivers finds no plane in its neighbors, but it does in their groups.
    bool join_missed() {
        std::vector<int> missed;
        for (int t = 0; t < count_; ++t) {
            for (int k = 0; k < 3; ++k) {
                const int other = triangles_[t].neighbor[k];
                if (label_[t] == label_[other]) continue;
                const int base = largest_[label_[other]];
                const int edge = 3 * t + k;
                if (area_[largest_[label_[t]]] < area_[base] && !joined_[edge] && is_near(base, t))
                    missed.push_back(edge);
            }
        }
        for (const int edge : missed) join(edge / 3, edge % 3);
        return !missed.empty();
    }

    const std::vector<Vec>& points_;
    const Triangles& triangles_;
    const double tolerance_;
    const int count_;
    std::vector<Vec> doubled_;   // area vectors, twice as long,
    std::vector<double> area_;   // and their lengths
    std::vector<int> label_, parent_, largest_;
    std::vector<bool> joined_;  // by triangle and corner
};

}  // namespace

FacetLabels facet_labels(const std::vector<Vec>& points, const Triangles& triangles,
                         double tolerance) {
    return Labeling(points, triangles, tolerance).run();
}

FacetLabels flat_labels(const std::vector<Vec>& points, const Triangles& triangles) {
    FacetLabels found{std::vector<int>(triangles.size(), NONE), 0};
    std::vector<int> front;
    for (std::size_t first = 0; first < triangles.size(); ++first) {
        if (found.label[first] != NONE) continue;
        found.label[first] = found.facets;
        front.assign(1, static_cast<int>(first));
        while (!front.empty()) {
            const int t = front.back();
            const Triangle& triangle = triangles[t];
            front.pop_back();
            for (const int other : triangle.neighbor) {
                if (found.label[other] != NONE) continue;
                const int beyond = triangles[other].corner[edge_to(triangles[other], t)];
                if (exact_side(points[triangle.corner[0]], points[triangle.corner[1]],
                               points[triangle.corner[2]], points[beyond]) != 0)
                    continue;
                found.label[other] = found.facets;
                front.push_back(other);
            }
        }
        ++found.facets;
    }
    return found;
}

}  // namespace dicedesign
