// Transitions from rest to rest, and their features in the momentum model: the formulas of
// dicedesign/throws/transition_features.py, with numbers of any kind. Features that both passes of
// a saddle share are computed once.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "throws/momentum.hpp"
#include "throws/tape.hpp"

namespace dicedesign {

// The passes and carries of a body, see `Passes` in transitions.py. Pass p goes over saddle p % s,
// from the basin on its side p / s to that on the other.
struct Ways {
    explicit Ways(const Landing& landing) {
        const auto saddles = static_cast<std::size_t>(landing.paths.saddles);
        std::vector<std::vector<Index>> leaving(static_cast<std::size_t>(landing.paths.rests));
        for (std::size_t pass = 0; pass < 2 * saddles; ++pass) {
            const Index* basins = landing.paths.basins + 2 * (pass % saddles);
            source.push_back(basins[pass / saddles]);
            target.push_back(basins[1 - pass / saddles]);
            leaving[static_cast<std::size_t>(source.back())].push_back(static_cast<Index>(pass));
        }
        for (std::size_t pass = 0; pass < 2 * saddles; ++pass) {
            for (const Index next : leaving[static_cast<std::size_t>(target[pass])]) {
                if (static_cast<std::size_t>(next) % saddles == pass % saddles) continue;
                first.push_back(static_cast<Index>(pass));
                second.push_back(next);
            }
        }
    }

    std::vector<Index> source, target;  // (m)
    std::vector<Index> first, second;   // (t)
};

template <class Real>
inline Vector<Real> product(const Symmetric<Real>& m, const Vector<Real>& a) {
    return {dot({m[0], m[3], m[5]}, a), dot({m[3], m[1], m[4]}, a), dot({m[5], m[4], m[2]}, a)};
}

template <class Real>
inline Real length(const Vector<Real>& a) {
    using std::sqrt;
    return sqrt(dot(a, a));
}

template <class Real>
inline Vector<Real> over(const Vector<Real>& a, const Real& b) {
    return Real(1.0) / b * a;
}

// The part of a vector perpendicular to a unit vector.
template <class Real>
inline Vector<Real> across(const Vector<Real>& a, const Vector<Real>& unit) {
    return a - dot(a, unit) * unit;
}

template <class Real>
inline Real angle(const Vector<Real>& a, const Vector<Real>& b) {
    using std::atan2;
    return atan2(length(cross(a, b)), dot(a, b));
}

// log(1 + exp(a))
inline double softplus(double a) { return std::fmax(a, 0.0) + std::log1p(std::exp(-std::fabs(a))); }

inline Traced softplus(const Traced& a) {
    return made(softplus(a.value), a, 1.0 / (1.0 + std::exp(-a.value)));
}

inline Vec value_of(const Vec& a) { return a; }

inline Vec value_of(const Vector<Traced>& a) { return {a.x.value, a.y.value, a.z.value}; }

// The place of the largest of some numbers.
template <class Number>
inline std::size_t place_of_largest(std::size_t count, const Number& number) {
    std::size_t place = 0;
    double most = number(0);
    for (std::size_t i = 1; i < count; ++i) {
        const double here = number(i);
        if (here > most) place = i, most = here;
    }
    return place;
}

// The part of its angular speed that a body keeps when it turns about a hinge, with `foot` nearest
// to the center of mass, and hits the table along the parallel through `far`. `inertia` is that
// about the parallel through the center of mass.
template <class Real>
inline Real speed_kept(const Real& inertia, const Vector<Real>& foot, const Vector<Real>& far) {
    return (inertia + dot(foot, far)) / (inertia + dot(far, far));
}

// What is known of a rest.
template <class Real>
struct Rest {
    Rest(const Hull& hull, Index facet, const std::vector<Vector<Real>>& arms,
         const Symmetric<Real>& inertia, const Real& probabilities) {
        using std::log;
        for (Index i = hull.facet_start[facet]; i < hull.facet_start[facet + 1]; ++i) {
            corners.push_back(arms[static_cast<std::size_t>(hull.tail[i])]);
        }
        const std::size_t count = corners.size();
        Vector<Real> doubled = cross(corners[1] - corners[0], corners[2] - corners[0]);
        for (std::size_t i = 3; i < count; ++i) {
            doubled = doubled + cross(corners[i - 1] - corners[0], corners[i] - corners[0]);
        }
        const Real size = length(doubled);
        normal = over(doubled, size);
        height = dot(normal, corners[0]);
        Real rolled = 0.0, border = 0.0;
        std::vector<Real> distances;
        std::vector<Vector<Real>> dual;
        for (std::size_t i = 0; i < count; ++i) {
            const Vector<Real> along = corners[(i + 1) % count] - corners[i];
            const Real side = length(along);
            const Vector<Real> edge = over(along, side), outward = cross(edge, normal);
            distances.push_back(dot(outward, corners[i]));
            dual.push_back(over(outward, distances[i]));
            const Vec out = value_of(outward);
            const auto depth = [&](std::size_t j) { return -dot(value_of(corners[j]), out); };
            const Vector<Real>& deepest = corners[place_of_largest(count, depth)];
            const Vector<Real> foot = across(corners[i], edge);
            const Vector<Real> far = foot - dot(corners[i] - deepest, outward) * outward;
            rolled += speed_kept(dot(edge, product(inertia, edge)), foot, far) * side;
            border += side;
        }
        Vector<Real> turned = cross(dual[count - 1], dual[0]);
        for (std::size_t i = 1; i < count; ++i) turned = turned + cross(dual[i - 1], dual[i]);
        const auto nearness = [&](std::size_t i) { return -value_of(distances[i]); };
        const auto distance = [&](std::size_t i) {
            const Vec a = value_of(corners[i]);
            return dot(a, a);
        };
        const Vector<Real>& outer = corners[place_of_largest(count, distance)];
        columns = {log(probabilities),
                   Real(0.5) * size,
                   log(Real(0.5) * dot(turned, normal)),
                   distances[place_of_largest(count, nearness)],
                   length(outer - height * normal),
                   rolled / border,
                   dot(normal, product(inertia, normal))};
    }

    std::vector<Vector<Real>> corners;
    Vector<Real> normal;
    Real height;
    std::array<Real, 7> columns;
};

// What is known of a saddle and one of the rests beside it.
template <class Real>
struct Side {
    Vector<Real> toward;  // the saddle's direction as seen on the facet
    Real barrier, angle, kept, reach;
    double forward;  // 1 if the body turns about the edge when it comes here, or -1
};

// What is known of a saddle.
template <class Real>
struct Hinge {
    Hinge(const Vector<Real>& tail, const Vector<Real>& head, const Symmetric<Real>& inertia,
          const std::array<const Rest<Real>*, 2>& rests) {
        using std::log;
        edge = over(head - tail, length(head - tail));
        foot = across(tail, edge);
        height = length(foot);
        saddle = over(foot, height);
        turned = product(inertia, edge);
        velocity = cross(foot, edge);
        about = dot(edge, turned);
        total = about + dot(foot, foot);
        narrowness = log(Real(1.0) / dot(foot - tail, edge) + Real(1.0) / dot(head - foot, edge));
        between = dicedesign::angle(rests[0]->normal, rests[1]->normal);
        for (std::size_t i = 0; i < 2; ++i) sides[i] = side(*rests[i]);
    }

    Side<Real> side(const Rest<Real>& rest) const {
        const Vector<Real> aslant = across(saddle, rest.normal);
        const Vector<Real> toward = over(aslant, length(aslant));
        const Vec back = value_of(toward);
        const auto depth = [&](std::size_t i) { return -dot(value_of(rest.corners[i]), back); };
        const Vector<Real>& deepest = rest.corners[place_of_largest(rest.corners.size(), depth)];
        const Vec there = value_of(rest.normal), up = value_of(saddle);
        const double turn = dot(cross(across(there, up), up), value_of(edge));
        return {toward,
                height - rest.height,
                dicedesign::angle(rest.normal, saddle),
                speed_kept(about, foot, across(deepest, edge)),
                dot(foot - deepest, toward),
                turn > 0.0 ? 1.0 : -1.0};
    }

    Vector<Real> edge, foot, saddle, turned, velocity;
    Real height, about, total, narrowness, between;
    std::array<Side<Real>, 2> sides;
};

// What is known of a body.
template <class Real>
struct ThrownBody {
    ThrownBody(const Landing& landing, const std::vector<Vector<Real>>& vertices,
               const Vector<Real>& center, const Symmetric<Real>& inertia_tensor,
               const std::vector<Real>& probabilities, const MomentumConstants& model_constants)
        : constants(model_constants) {
        std::vector<Vector<Real>> arms;
        for (const Vector<Real>& vertex : vertices) arms.push_back(vertex - center);
        const auto distance = [&](std::size_t i) {
            const Vec a = value_of(arms[i]);
            return dot(a, a);
        };
        const Vector<Real>& longest = arms[place_of_largest(arms.size(), distance)];
        const Real square = dot(longest, longest), radius = length(longest);
        for (Vector<Real>& arm : arms) arm = over(arm, radius);
        Symmetric<Real> inertia = inertia_tensor;
        for (Real& entry : inertia) entry = entry / square;
        trace = inertia[0] + inertia[1] + inertia[2];
        for (std::size_t i = 0; i < probabilities.size(); ++i) {
            rests.emplace_back(landing.hull, landing.paths.resting[i], arms, inertia, probabilities[i]);
        }
        for (Index i = 0; i < landing.paths.saddles; ++i) {
            const auto of = [&](const Index* pair, std::size_t end) {
                return static_cast<std::size_t>(pair[2 * static_cast<std::size_t>(i) + end]);
            };
            const Index *ends = landing.paths.saddle_ends, *basins = landing.paths.basins;
            hinges.emplace_back(
                arms[of(ends, 0)], arms[of(ends, 1)], inertia,
                std::array<const Rest<Real>*, 2>{&rests[of(basins, 0)], &rests[of(basins, 1)]});
        }
    }

    const Hinge<Real>& hinge(Index pass) const {
        return hinges[static_cast<std::size_t>(pass) % hinges.size()];
    }

    // Of the rest before a pass, and of the rest after it.
    const Side<Real>& before(Index pass) const {
        return hinge(pass).sides[static_cast<std::size_t>(pass) / hinges.size()];
    }

    const Side<Real>& after(Index pass) const {
        return hinge(pass).sides[1 - static_cast<std::size_t>(pass) / hinges.size()];
    }

    // The columns of a pass, as `PASS_FEATURES`.
    std::array<Real, PASS_FEATURES> pass_features(const Ways& ways, Index pass) const {
        using std::log;
        const Hinge<Real>& here = hinge(pass);
        const Side<Real>&from = before(pass), &to = after(pass);
        std::array<Real, PASS_FEATURES> row = {from.barrier,
                                               to.barrier,
                                               log(from.barrier + Real(constants.log_softening)),
                                               log(to.barrier + Real(constants.log_softening)),
                                               here.height,
                                               here.narrowness,
                                               from.angle,
                                               to.angle,
                                               here.between,
                                               here.about,
                                               from.kept,
                                               to.kept,
                                               from.reach,
                                               to.reach,
                                               trace};
        const auto p = static_cast<std::size_t>(pass);
        const auto& source = rests[static_cast<std::size_t>(ways.source[p])].columns;
        const auto& target = rests[static_cast<std::size_t>(ways.target[p])].columns;
        for (std::size_t i = 0; i < source.size(); ++i) {
            row[15 + 2 * i] = source[i];
            row[16 + 2 * i] = target[i];
        }
        return row;
    }

    // The columns of a carry, as `CARRY_FEATURES`.
    std::array<Real, CARRY_FEATURES> carry_features(const Ways& ways, std::size_t carry) const {
        using std::sqrt;
        const Index a = ways.first[carry], b = ways.second[carry];
        const Hinge<Real>&first = hinge(a), &second = hinge(b);
        const Side<Real>&coming = after(a), &going = before(b);
        const Real sense = coming.forward * after(b).forward;
        const Real momentum =
            dot(second.edge, first.turned) + dot(first.velocity, second.velocity);
        const Real kept = sense * momentum / sqrt(first.total * second.total);
        const Real speed = Real(0.5) * (kept + sqrt(kept * kept + Real(constants.speed_softening)));
        const Real energy = speed * speed;
        Real lacking = going.barrier / (energy + Real(constants.energy_softening)) - coming.barrier;
        if (!(value_of(lacking) < constants.most_lacking)) lacking = constants.most_lacking;
        const bool is_return = ways.source[static_cast<std::size_t>(a)] ==
                               ways.target[static_cast<std::size_t>(b)];
        return {kept,
                energy,
                -dot(coming.toward, going.toward),
                going.barrier,
                coming.barrier,
                lacking,
                is_return ? 1.0 : 0.0,
                softplus(Real(constants.sharpness) * lacking),
                coming.kept,
                coming.angle,
                first.about,
                coming.reach,
                going.angle,
                second.narrowness};
    }

    std::vector<Rest<Real>> rests;
    std::vector<Hinge<Real>> hinges;
    Real trace;
    const MomentumConstants& constants;
};

}  // namespace dicedesign
