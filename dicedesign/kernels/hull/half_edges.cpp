#include "hull/half_edges.hpp"

#include <algorithm>
#include <numeric>

namespace dicedesign {
namespace {

// An edge of triangle t has the number 4 t + k, where k is the corner opposite to it. Half-edges
// are found facet by facet as triangles come, and put in order at the end: neighbors are near each
// other in memory until then.
class FacetLoops {
public:
    FacetLoops(const std::vector<int>& number, const Triangles& triangles,
               const FacetLabels& facets)
        : point_number_(number), triangles_(triangles), label_(facets.label),
          facets_(facets.facets), degree_(number.size(), 0), passed_(number.size(), NONE) {}

    std::optional<HalfEdges> run() {
        if (facets_ < 4) return std::nullopt;
        find_borders();
        if (!walk_all()) return std::nullopt;
        HalfEdges found;
        const int vertices = number_vertices(found.source);
        if (vertices - static_cast<int>(corner_.size()) / 2 + facets_ != 2) return std::nullopt;
        arrange(vertices, found);
        return found;
    }

private:
    static int triangle(int edge) { return edge >> 2; }
    static int side(int edge) { return edge & 3; }
    int tail(int edge) const { return triangles_[triangle(edge)].corner[NEXT[side(edge)]]; }
    bool is_border(int edge) const { return border_[triangle(edge)] >> side(edge) & 1; }

    int opposite(int edge) const {
        const int other = triangles_[triangle(edge)].neighbor[side(edge)];
        return 4 * other + edge_to(triangles_[other], triangle(edge));
    }

    int following(int edge) const {
        const auto turned = [](int e) { return (e & ~3) + NEXT[side(e)]; };
        edge = turned(edge);
        while (!is_border(edge)) edge = turned(opposite(edge));
        return edge;
    }

    void find_borders() {
        const std::size_t count = triangles_.size();
        border_.assign(count, 0);
        for (std::size_t t = 0; t < count; ++t) {
            const Triangle& triangle = triangles_[t];
            for (int k = 0; k < 3; ++k) {
                const bool is_border = label_[t] != label_[triangle.neighbor[k]];
                border_[t] |= is_border << k;
                degree_[triangle.corner[NEXT[k]]] += is_border;
            }
        }
    }

    bool walk_all() {
        const int count = static_cast<int>(triangles_.size());
        walked_.assign(count, 0);
        half_edge_.resize(4 * static_cast<std::size_t>(count));
        start_.reserve(facets_ + 1);
        start_.push_back(0);
        corner_.reserve(3 * static_cast<std::size_t>(count));
        last_.reserve(3 * static_cast<std::size_t>(count));
        std::vector<char> found(facets_, 0);
        for (int t = 0; t < count; ++t) {
            for (int k = 0; k < 3; ++k) {
                if (!((border_[t] & ~walked_[t]) >> k & 1)) continue;
                // A facet whose border is two loops, or passes a point twice, is no polygon.
                if (found[label_[t]] || !walk(4 * t + k)) return false;
                found[label_[t]] = 1;
            }
        }
        return static_cast<int>(start_.size()) == facets_ + 1;
    }

    // The loop of a facet that begins with an edge, without the corners that are left out.
    bool walk(int first) {
        const int facet = static_cast<int>(start_.size()) - 1;
        const int start = first;
        while (degree_[tail(first)] < 3) {
            first = following(first);
            if (first == start) return false;
        }
        int edge = first;
        do {
            const int corner = tail(edge);
            if (passed_[corner] == facet) return false;
            passed_[corner] = facet;
            walked_[triangle(edge)] |= 1 << side(edge);
            if (degree_[corner] >= 3) {
                half_edge_[edge] = static_cast<int>(corner_.size());
                corner_.push_back(corner);
                last_.push_back(edge);
            } else {
                last_.back() = edge;
            }
            edge = following(edge);
        } while (edge != first);
        start_.push_back(static_cast<int>(corner_.size()));
        label_of_.push_back(label_[triangle(first)]);
        return start_[facet + 1] - start_[facet] >= 3;
    }

    // Vertices are the corners in the order of the points' numbers.
    int number_vertices(std::vector<Index>& source) {
        std::vector<int> vertex(degree_.size(), NONE);
        for (std::size_t p = 0; p < degree_.size(); ++p)
            if (degree_[p] >= 3) vertex[point_number_[p]] = 0;
        for (std::size_t i = 0; i < vertex.size(); ++i) {
            if (vertex[i] == NONE) continue;
            vertex[i] = static_cast<int>(source.size());
            source.push_back(static_cast<Index>(i));
        }
        std::vector<int>& of_point = passed_;
        for (std::size_t p = 0; p < degree_.size(); ++p) of_point[p] = vertex[point_number_[p]];
        for (int& corner : corner_) corner = of_point[corner];
        return static_cast<int>(source.size());
    }

    // Facets in the order that `ConvexHull` describes.
    void arrange(int vertices, HalfEdges& found) const {
        std::vector<int> lowest(facets_), second(facets_), bucket(vertices + 1, 0);
        for (int f = 0; f < facets_; ++f) {
            const int begin = start_[f], end = start_[f + 1];
            int best = begin;
            for (int i = begin + 1; i < end; ++i) best = corner_[i] < corner_[best] ? i : best;
            lowest[f] = best;
            second[f] = corner_[best + 1 == end ? begin : best + 1];
            ++bucket[corner_[best] + 1];
        }
        std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());
        std::vector<int> order(facets_), filled(bucket.begin(), bucket.end() - 1);
        for (int f = 0; f < facets_; ++f) order[filled[corner_[lowest[f]]]++] = f;
        for (int v = 0; v < vertices; ++v)
            if (bucket[v + 1] - bucket[v] > 1)
                std::sort(order.begin() + bucket[v], order.begin() + bucket[v + 1],
                          [&second](int f, int g) { return second[f] < second[g]; });

        found.facet_start.resize(facets_ + 1);
        found.facet_of_label.resize(facets_);
        std::vector<int>& placed = second;
        for (int rank = 0, next = 0; rank < facets_; ++rank) {
            const int f = order[rank];
            placed[f] = next;
            found.facet_of_label[label_of_[f]] = rank;
            next += start_[f + 1] - start_[f];
            found.facet_start[rank + 1] = next;
        }
        std::vector<int> place(corner_.size());
        for (int f = 0; f < facets_; ++f) {
            const int size = start_[f + 1] - start_[f];
            for (int i = start_[f]; i < start_[f + 1]; ++i)
                place[i] = placed[f] + i - lowest[f] + (i < lowest[f] ? size : 0);
        }
        found.tail.resize(corner_.size());
        found.twin.resize(corner_.size());
        for (std::size_t i = 0; i < corner_.size(); ++i) {
            found.tail[place[i]] = corner_[i];
            found.twin[place[i]] = place[half_edge_[opposite(last_[i])]];
        }
    }

    const std::vector<int>& point_number_;
    const Triangles& triangles_;
    const std::vector<int>& label_;
    const int facets_;
    std::vector<int> degree_;  // facets that meet at a point
    std::vector<int> passed_;  // the facet that passed a point last
    // By triangle, a bit for each edge.
    std::vector<unsigned char> border_, walked_;
    std::vector<int> half_edge_;  // by edge, the one that begins with it
    // By facet its label and first half-edge, by half-edge its corner and the last of its edges.
    std::vector<int> label_of_, start_, corner_, last_;
};

}  // namespace

std::optional<HalfEdges> facet_loops(const std::vector<int>& number, const Triangles& triangles,
                                     const FacetLabels& facets) {
    return FacetLoops(number, triangles, facets).run();
}

}  // namespace dicedesign
