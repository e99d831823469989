#include "rest/lines.hpp"

#include <cmath>
#include <limits>
#include <type_traits>

namespace dicedesign {
namespace {

// Where a line is: a direction of length 1 on the border of a cell or in it, wrong by no more than
// the error beside the line.
template <class Real>
struct Place {
    Vector<Real> direction;
    double error;
};

// Which side of a facet's normal a line passes, as a product with its length; in doubles where these
// suffice, unless all digits are wanted.
template <class Real>
double side_of(const Frame<Real>& frame, Index facet, const Vector<Real>& left_of_travel,
               double reach, bool all_digits) {
    if (!all_digits) {
        const Vec left = rounded(left_of_travel);
        const double coarse = dot(left, frame.hull.normals[facet]);
        if (std::fabs(coarse) > reach + norm(left) * frame.normal_error_of_doubles(facet)) return coarse;
    }
    return rounded(dot(left_of_travel, frame.normal(facet)));
}

// Where the line through a place leaves the cell of a vertex: the half-edge through whose arc, or
// -1 where there is none. See `exit_half_edges` in tracing.py.
template <class Real>
Index exit_half_edge(const Frame<Real>& frame, const std::vector<char>& allowed, Index vertex,
                     const Place<Real>& place, bool uphill, bool& certain,
                     bool all_digits = std::is_same_v<Real, double>) {
    const Hull& hull = frame.hull;
    const Vector<Real> along = frame.radius(vertex);
    const Vector<Real> left_of_travel = cross(place.direction, uphill ? along : -along);
    const double slack = norm(rounded(along)) * (place.error + frame.rounding);
    const double length = norm(rounded(left_of_travel));
    Index chosen = -1;
    double highest = -std::numeric_limits<double>::infinity();
    for (Index k = hull.outgoing_start[vertex]; k < hull.outgoing_start[vertex + 1]; ++k) {
        const Index e = hull.outgoing[k];
        if (!allowed[e]) continue;
        const Index left = hull.facet[e], right = hull.facet[hull.twin[e]];
        const bool first = !allowed[hull.next[hull.twin[e]]];
        const bool last = !allowed[hull.twin[hull.previous[e]]];
        const double reach =
            slack + frame.tolerances.tie_distance + length * frame.normal_error(left);
        const double at_left = side_of(frame, left, left_of_travel, reach, all_digits);
        const double at_right = side_of(frame, right, left_of_travel, 0.0, all_digits);
        if (!last && !(std::fabs(at_left) > reach)) certain = false;
        const bool leaves = (first || at_right < 0.0) && (last || at_left >= 0.0);
        const double score = leaves ? std::numeric_limits<double>::infinity()
                                    : std::fmin(at_left, -at_right);
        if (chosen < 0 || score > highest) {
            chosen = e;
            highest = score;
        }
    }
    // All digits count where no side alone decides.
    if (!all_digits && chosen >= 0 && std::isfinite(highest))
        return exit_half_edge(frame, allowed, vertex, place, uphill, certain, true);
    return chosen;
}

// Moves a place to where the line crosses the arc of a half-edge. See `crossing` in tracing.py.
template <class Real>
void cross_arc(const Frame<Real>& frame, Index e, bool uphill,
               Place<Real>& place) {
    const Hull& hull = frame.hull;
    const Vector<Real> r = frame.radius(hull.tail[e]), v = frame.edge(e);
    const Vector<Real> point = oblique_projection(place.direction, r, v);
    const double length = norm(rounded(point));
    if (!(length > 0.0)) {
        // A line that starts exactly at r_p has no direction; it may as well run to the arc's end.
        place = {frame.normal(hull.facet[e]), 1.0};
        return;
    }
    const double inverse = (uphill ? 1.0 : -1.0) / length;
    place.direction = Real(inverse) * point;
    const Vec unit = rounded(place.direction);
    const double edge = norm(rounded(v));
    const double shrink = norm(cross(rounded(r), unit)) * edge / length;
    const double ahead = norm(cross(rounded(frame.radius(hull.head[e])), unit));
    const double turn = edge / std::fmax(ahead, edge);
    place.error = place.error * shrink +
                  frame.rounding * (1.0 + norm(rounded(r)) * edge / length * turn) +
                  frame.tolerances.tie_distance * edge / length;
}

// The saddle direction of a half-edge.
template <class Real>
Place<Real> saddle_point(const Frame<Real>& frame, Index e) {
    const Vector<Real> a = frame.radius(frame.hull.tail[e]), b = frame.radius(frame.hull.head[e]);
    const Vector<Real> v = frame.edge(e);
    const double near = norm(rounded(a)), far = norm(rounded(b));
    const Vector<Real> direction = oblique_projection(near <= far ? a : b, v, v);
    const double length = norm(rounded(direction)), edge = norm(rounded(v));
    const double size = std::fmin(near, far) * edge * edge;
    const double error = frame.rounding * (1.0 + size / length) +
                         frame.tolerances.tie_distance * edge * edge / length;
    return {Real(1.0 / length) * direction, error};
}

template <class Real>
bool ascends(const Frame<Real>& frame, const Elements& elements,
             Index saddle, Index vertex, std::vector<Index>& crossed, Index& maximum) {
    Place<Real> place = saddle_point(frame, saddle);
    bool certain = true;
    while (!elements.maximum[vertex]) {
        const Index e =
            exit_half_edge(frame, elements.ascending, vertex, place, true, certain);
        if (!certain || e < 0) return false;
        cross_arc(frame, e, true, place);
        crossed.push_back(e);
        vertex = frame.hull.head[e];
    }
    maximum = vertex;
    return true;
}

// Facet that a body tips onto which touches the table along a hinge edge.
template <class Real>
Index tipped(const Frame<Real>& frame, const Elements& elements,
             Index e, const Place<Real>& place, bool& certain) {
    const Hull& hull = frame.hull;
    const Index twin = hull.twin[e];
    if (elements.side_sign[e] < 0) return hull.facet[twin];
    if (elements.side_sign[twin] < 0) return hull.facet[e];
    const Vector<Real> r = frame.radius(hull.tail[e]), v = frame.edge(e);
    const double value = rounded(dot(r, cross(v, place.direction)));
    const double edge = norm(rounded(v));
    const double reach = norm(rounded(r)) * edge * (place.error + frame.rounding) +
                         frame.tolerances.tie_distance * edge;
    if (!(std::fabs(value) > reach)) certain = false;
    return hull.facet[value > 0.0 ? e : twin];
}

// Follows a line downhill to a hinge edge; false where rounding can change the facet reached.
template <class Real>
bool descends(const Frame<Real>& frame, const Elements& elements,
              Index vertex, Place<Real> place, Index& reached) {
    bool certain = true;
    while (true) {
        const Index e =
            exit_half_edge(frame, elements.descending, vertex, place, false, certain);
        if (e < 0) return false;
        cross_arc(frame, e, false, place);
        if (elements.hinge[e]) {
            reached = tipped(frame, elements, e, place, certain);
            return certain;
        }
        vertex = frame.hull.head[e];
    }
}

// Whether `follow` follows a line to its end in doubles, or else with as many digits as it takes,
// unless ties are looked for.
template <class Follow>
Verdict follow_surely(const Frame<double>& frame, const Follow& follow) {
    if (follow(frame)) return Verdict::certain;
    if (frame.tolerances.tie_distance > 0.0) return Verdict::tied;
    const bool sure = follow(frame.with<Twofold>()) || follow(frame.with<Wide<8>>()) ||
                      follow(frame.with<Wide<16>>()) || follow(frame.with<Wide<32>>()) ||
                      follow(frame.with<Wide<128>>());
    return sure ? Verdict::certain : Verdict::uncertain;
}

}  // namespace

Verdict ascend(const Frame<double>& frame, const Elements& elements, Index saddle, Index vertex,
               std::vector<Index>& crossed, Index& maximum) {
    const std::size_t before = crossed.size();
    return follow_surely(frame, [&](const auto& finer) {
        crossed.resize(before);
        return ascends(finer, elements, saddle, vertex, crossed, maximum);
    });
}

Verdict descend(const Frame<double>& frame, const Elements& elements, Index facet,
                Index& reached) {
    const Index vertex = roll_vertex(frame, elements, facet);
    return follow_surely(frame, [&](const auto& finer) {
        return descends(finer, elements, vertex, {finer.normal(facet), finer.normal_error(facet)},
                        reached);
    });
}

bool slide(const Frame<double>& frame, const Elements& elements, Index vertex,
           const Vec& direction, double error, Index& reached) {
    reached = -1;
    return descends(frame, elements, vertex, Place<double>{direction, error}, reached);
}

}  // namespace dicedesign
