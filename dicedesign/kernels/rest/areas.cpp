#include "rest/areas.hpp"

#include <algorithm>
#include <limits>

namespace dicedesign {
namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();

// A sum of angles, kept as a product of complex numbers: one arc tangent serves all of them.
struct Turn {
    double real = 1.0, imaginary = 0.0;
    double rounds = 0.0;

    // Add the angle, in (-pi, pi), of a complex number.
    void add(double x, double y) {
        const double re = real * x - imaginary * y, im = real * y + imaginary * x;
        if (imaginary >= 0.0 && y >= 0.0) {
            rounds += im < 0.0 ? 1.0 : 0.0;
        } else if (imaginary < 0.0 && y < 0.0) {
            rounds -= im >= 0.0 ? 1.0 : 0.0;
        }
        real = re;
        imaginary = im;
        const double size = std::fabs(re) + std::fabs(im);
        if (size < 0x1p-400 || size > 0x1p400) {
            const double scale = size < 1.0 ? 0x1p400 : 0x1p-400;
            real *= scale;
            imaginary *= scale;
        }
    }

    double angle() const { return std::atan2(imaginary + 0.0, real) + 2.0 * PI * rounds; }
};

// The points of all branches, branch after branch.
struct Border {
    std::vector<Vec> points;
    std::vector<std::size_t> start;
};

Border all_points(const Paths& paths, const Vec* vertices, const Vec& center) {
    const Index branches = 2 * paths.saddles;
    Border border;
    border.points.reserve(static_cast<std::size_t>(paths.branch_start[branches] + 2 * branches));
    border.start.reserve(static_cast<std::size_t>(branches) + 1);
    for (Index branch = 0; branch < branches; ++branch) {
        border.start.push_back(border.points.size());
        branch_points(paths, branch, vertices, center, border.points);
    }
    border.start.push_back(border.points.size());
    return border;
}

// 1 + cosine from the antipode of a direction to the nearest of an arc's first end and middle, where
// that is below 1.
double gap(const Vec& direction, const Vec& a, const Vec& b) {
    const double at_end = dot(direction, a);
    const Vec middle = a + b;
    const double along = dot(direction, middle);
    if (along >= 0.0) return 1.0 + at_end;
    return 1.0 + std::fmin(at_end, along / norm(middle));
}

// The least such gap of each basin's border from its direction.
std::vector<double> nearest_gaps(const Paths& paths, const Border& border,
                                 const std::vector<Vec>& directions) {
    std::vector<double> nearest(directions.size(), INFINITE);
    for (Index branch = 0; branch < 2 * paths.saddles; ++branch) {
        const std::size_t last = border.start[branch + 1] - 1;
        for (int side = 0; side < 2; ++side) {
            const Index basin = paths.basins[2 * (branch / 2) + side];
            const Vec& direction = directions[basin];
            double least = 1.0 + dot(direction, border.points[last]);
            for (std::size_t i = border.start[branch]; i < last; ++i) {
                least = std::fmin(least, gap(direction, border.points[i], border.points[i + 1]));
            }
            nearest[basin] = std::fmin(nearest[basin], least);
        }
    }
    return nearest;
}

// A direction for each basin from which its area can be measured without cancellation: a triangle
// between nearly opposite directions has no area to speak of.
std::vector<Vec> basin_references(const Paths& paths, const Border& border, const Hull& hull,
                                  double near_antipode) {
    std::vector<Vec> references;
    references.reserve(static_cast<std::size_t>(paths.rests));
    for (Index k = 0; k < paths.rests; ++k) references.push_back(hull.normals[paths.resting[k]]);
    std::vector<double> nearest = nearest_gaps(paths, border, references);
    std::vector<char> poor(nearest.size());
    for (std::size_t k = 0; k < nearest.size(); ++k) poor[k] = nearest[k] < near_antipode;
    if (std::find(poor.begin(), poor.end(), 1) == poor.end()) return references;
    const Vec axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
    for (const Vec& axis : axes) {
        const std::vector<Vec> same(references.size(), axis);
        const std::vector<double> gaps = nearest_gaps(paths, border, same);
        for (std::size_t k = 0; k < gaps.size(); ++k) {
            if (poor[k] && gaps[k] > nearest[k]) {
                references[k] = axis;
                nearest[k] = gaps[k];
            }
        }
    }
    return references;
}

}  // namespace

void branch_points(const Paths& paths, Index branch, const Vec* vertices, const Vec& center,
                   std::vector<Vec>& points) {
    const Index* ends = paths.saddle_ends + 2 * (branch / 2);
    const Vec a = vertices[ends[0]] - center, b = vertices[ends[1]] - center;
    const Vec v = vertices[ends[1]] - vertices[ends[0]];
    // From the nearer end: from a far one digits cancel.
    const Vec& nearer = dot(a, a) <= dot(b, b) ? a : b;
    const Vec saddle = oblique_projection(nearer, v, v);
    Vec point = (1.0 / norm(saddle)) * saddle;
    points.push_back(point);
    for (Index i = paths.branch_start[branch]; i < paths.branch_start[branch + 1]; ++i) {
        const Vec& p = vertices[paths.crossings[2 * i]];
        const Vec& q = vertices[paths.crossings[2 * i + 1]];
        const Vec moved = oblique_projection(point, p - center, q - p);
        const double size = norm(moved);
        if (size > 0.0) point = (1.0 / size) * moved;
        points.push_back(point);
    }
    const Vec end = vertices[paths.maxima[branch]] - center;
    points.push_back((1.0 / norm(end)) * end);
}

std::vector<double> signed_areas(const Hull& hull, const Paths& paths, const Vec& center,
                                 double near_antipode) {
    const Border border = all_points(paths, hull.vertices, center);
    const std::vector<Vec> references = basin_references(paths, border, hull, near_antipode);
    std::vector<Turn> turns(references.size());
    for (Index branch = 0; branch < 2 * paths.saddles; ++branch) {
        // The branch into the head's cell runs along the left basin's border, the other against it.
        const Index* basins = paths.basins + 2 * (branch / 2);
        const Index left = basins[branch % 2], right = basins[1 - branch % 2];
        const Vec n = references[left], m = references[right];
        for (std::size_t i = border.start[branch]; i + 1 < border.start[branch + 1]; ++i) {
            const Vec &a = border.points[i], &b = border.points[i + 1];
            // Half the solid angle of a triangle (Van Oosterom and Strackee, 1983).
            const Vec plane = cross(a, b), both = a + b;
            const double one = 1.0 + dot(a, b);
            turns[left].add(one + dot(n, both), dot(n, plane));
            turns[right].add(one + dot(m, both), -dot(m, plane));
        }
    }
    std::vector<double> areas(turns.size());
    for (std::size_t k = 0; k < areas.size(); ++k) areas[k] = 2.0 * turns[k].angle();
    return areas;
}

bool close_areas(std::vector<double>& areas, double tolerance) {
    double total = 0.0;
    for (const double area : areas) total += area;
    // A basin that contains the antipode of its reference comes out too small by 4 pi; the sum
    // tells how many do, and they are the most negative ones.
    std::vector<char> whole(areas.size());
    for (double missing = std::round(1.0 - total / (4.0 * PI)); missing > 0.5; missing -= 1.0) {
        std::size_t lowest = areas.size();
        for (std::size_t k = 0; k < areas.size(); ++k) {
            if (!whole[k] && (lowest == areas.size() || areas[k] < areas[lowest])) lowest = k;
        }
        if (lowest == areas.size()) return false;
        areas[lowest] += 4.0 * PI;
        whole[lowest] = 1;
    }
    total = 0.0;
    bool covers = true;
    for (const double area : areas) {
        total += area;
        covers = covers && area > -tolerance;
    }
    // Not a number either.
    if (!(covers && std::fabs(total - 4.0 * PI) <= tolerance)) return false;
    // The smallest of basins come out as rounding noise.
    for (double& area : areas) area = std::fmax(area, std::numeric_limits<double>::min());
    return true;
}

}  // namespace dicedesign
