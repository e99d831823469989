// A closed surface of triangles.
#pragma once

#include <vector>

#include "vector.hpp"

namespace dicedesign {

// Corners counter-clockwise seen from outside; neighbor[k] lies across the edge opposite to
// corner[k], which goes from corner[k + 1] to corner[k + 2].
struct Triangle {
    int corner[3];
    int neighbor[3];
};

using Triangles = std::vector<Triangle>;

// In place of an index.
inline constexpr int NONE = -1;

inline constexpr int NEXT[3] = {1, 2, 0};
inline constexpr int LAST[3] = {2, 0, 1};

// The edge of a triangle that a neighbor lies across; no processor would guess a branch here.
inline int edge_to(const Triangle& triangle, int neighbor) {
    return (triangle.neighbor[1] == neighbor) + 2 * (triangle.neighbor[2] == neighbor);
}

// Which of three numbers is the largest, the first of equal ones.
inline int largest_of(double a, double b, double c) {
    const int found = b > a;
    return c > (b > a ? b : a) ? 2 : found;
}

// Twice the area vector of a triangle, as the cross product of its two shorter edges: of two long
// and nearly parallel ones it would be rounding noise.
inline Vec doubled_area_vector(const Vec& a, const Vec& b, const Vec& c) {
    const Vec edge[3] = {b - a, c - b, a - c};
    const int longest =
        largest_of(dot(edge[0], edge[0]), dot(edge[1], edge[1]), dot(edge[2], edge[2]));
    return cross(edge[NEXT[longest]], edge[LAST[longest]]);
}

}  // namespace dicedesign
