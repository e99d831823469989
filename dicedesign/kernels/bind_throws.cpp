// Kernels of `dicedesign.throws`.
#include <algorithm>

#include "arrays.hpp"
#include "throws.hpp"

namespace dicedesign {
namespace {

using States = nb::ndarray<double, nb::shape<-1, 13>, nb::c_contig, nb::device::cpu>;

Landscape landscape_of(const Points& vertices, const Indices& start, const Indices& neighbor,
                       const Indices& left, const Indices& right, const Points& normals,
                       const Indices& rests, const Floats& barriers) {
    double highest = 0.0;
    for (std::size_t i = 0; i < barriers.shape(0); ++i) highest = larger(highest, barriers(i));
    return {static_cast<Index>(vertices.shape(0)),
            rows(vertices),
            start.data(),
            neighbor.data(),
            left.data(),
            right.data(),
            rows(normals),
            rests.data(),
            barriers.data(),
            highest};
}

// For each direction the rest in whose basin it lies, or -1.
nb::object rests_below(Points vertices, Indices start, Indices neighbor, Indices left,
                       Indices right, Points normals, Indices rests, Floats barriers,
                       Points directions) {
    const Landscape land =
        landscape_of(vertices, start, neighbor, left, right, normals, rests, barriers);
    std::vector<Index> found(directions.shape(0));
    for (std::size_t i = 0; i < found.size(); ++i) {
        found[i] = rest_below(land, rows(directions)[i]);
    }
    return array(std::move(found));
}

// Advance throws by at most `steps` steps each. States (n, 13) are positions, quaternions,
// velocities and angular velocities, and are overwritten; `how` (8,) is step, gravity, drag,
// stiffness, damping, sliding damping, friction and impedance. Returns for each throw its rest, or
// -1 while it moves, and the steps it took.
nb::tuple advance_throws(Points vertices, Indices start, Indices neighbor, Indices left,
                         Indices right, Points normals, Indices rests, Floats barriers,
                         Floats moments, Floats how, States states, Index steps) {
    const Landscape land =
        landscape_of(vertices, start, neighbor, left, right, normals, rests, barriers);
    const Throw thrown{{how(3), how(4), how(5), how(6), how(7)}, how(0), how(1), how(2)};
    const Vec inertia = vector(moments);
    const std::size_t count = states.shape(0);
    std::vector<Index> outcome(count), taken(count);
    {
        const nb::gil_scoped_release others_may_run;
        for (std::size_t i = 0; i < count; ++i) {
            double* const s = states.data() + 13 * i;
            Motion motion{{s[0], s[1], s[2]}, {s[3], s[4], s[5], s[6]}, {s[7], s[8], s[9]},
                          {s[10], s[11], s[12]}};
            outcome[i] = advance(land, inertia, thrown, steps, motion, taken[i]);
            const double after[13] = {motion.position.x, motion.position.y, motion.position.z,
                                      motion.turn[0],    motion.turn[1],    motion.turn[2],
                                      motion.turn[3],    motion.velocity.x, motion.velocity.y,
                                      motion.velocity.z, motion.spin.x,     motion.spin.y,
                                      motion.spin.z};
            std::copy(after, after + 13, s);
        }
    }
    return nb::make_tuple(array(std::move(outcome)), array(std::move(taken)));
}

}  // namespace

void bind_throws(nb::module_& module) {
    module.def("rests_below", &rests_below);
    module.def("advance_throws", &advance_throws);
}

}  // namespace dicedesign
