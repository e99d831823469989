// Kernels of `dicedesign.throws`.
#include <nanobind/stl/array.h>

#include <algorithm>

#include "arrays.hpp"
#include "hull/handle.hpp"
#include "rest/paths.hpp"
#include "throws/momentum.hpp"
#include "throws/throws.hpp"

namespace dicedesign {
namespace {

using States = nb::ndarray<double, nb::shape<-1, 13>, nb::c_contig, nb::device::cpu>;
using Tensor = nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;

Landscape landscape_of(const Points& vertices, const Indices& start, const Indices& neighbor,
                       const Indices& left, const Indices& right, const Points& normals,
                       const Indices& rests, const Floats& barriers, const double* flat) {
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
            flat,
            highest};
}

// For each direction the rest in whose basin it lies, or -1.
nb::object rests_below(Points vertices, Indices start, Indices neighbor, Indices left,
                       Indices right, Points normals, Indices rests, Floats barriers,
                       Points directions) {
    const Landscape land =
        landscape_of(vertices, start, neighbor, left, right, normals, rests, barriers, nullptr);
    std::vector<Index> found(directions.shape(0));
    for (std::size_t i = 0; i < found.size(); ++i) {
        found[i] = rest_below(land, rows(directions)[i]);
    }
    return array(std::move(found));
}

// Advance throws by at most `steps` steps each. `how` (5,) is step, gravity, drag, restitution and
// friction. States (n, 13) are positions, quaternions, velocities and angular velocities, and are
// overwritten. Returns for each throw its rest, or -1 while it moves, and the steps it took.
nb::tuple advance_throws(Points vertices, Indices start, Indices neighbor, Indices left,
                         Indices right, Points normals, Indices rests, Floats barriers,
                         Points flat, Floats moments, Floats how, States states, Index steps) {
    const Landscape land =
        landscape_of(vertices, start, neighbor, left, right, normals, rests, barriers, flat.data());
    const Throw thrown{{how(3), how(4)}, how(0), how(1), how(2)};
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

// The parameters of a `MomentumModel` with the constants of the model.
class MomentumHandle {
public:
    // parameters: three numbers and two networks as `Momentum` has them; hidden: units of the
    // networks; repeats, constants: as `MomentumConstants` has them.
    MomentumHandle(Floats parameters, std::array<std::size_t, 2> hidden,
                   std::array<std::size_t, 2> repeats, std::array<double, 9> constants)
        : parameters_(parameters), next_(parameters.data() + 3) {
        const MomentumNetwork passes = network(PASS_FEATURES, PASS_OUTPUTS, hidden[0]);
        const MomentumNetwork carries = network(CARRY_FEATURES, CARRY_OUTPUTS, hidden[1]);
        const auto [most_rate, most_stretch, no_barrier, log_softening, speed_softening,
                    energy_softening, most_lacking, sharpness, rounding] = constants;
        model_ = {parameters(0),
                  parameters(1),
                  parameters(2),
                  passes,
                  carries,
                  {repeats[0], repeats[1], most_rate, most_stretch, no_barrier, log_softening,
                   speed_softening, energy_softening, most_lacking, sharpness, rounding}};
        if (next_ != parameters.data() + parameters.shape(0)) {
            throw nb::value_error("momentum model: networks of another shape than the kernels'");
        }
    }

    const Momentum& operator*() const { return model_; }

private:
    MomentumNetwork network(std::size_t inputs, std::size_t outputs, std::size_t units) {
        const double* const linear = take(inputs * outputs);
        const double* const bias = take(outputs);
        const double* const inward = take(inputs * units);
        const double* const shift = take(units);
        return MomentumNetwork{linear, bias, inward, shift, take(units * outputs), units};
    }

    const double* take(std::size_t count) {
        next_ += count;
        return next_ - count;
    }

    Floats parameters_;  // kept, for the model points into them
    const double* next_;
    Momentum model_;
};

// Probabilities (k,) of the rests of a thrown body with a tensor of inertia over the mass.
nb::object probabilities_of_thrown(const HullHandle& hull, const PathsHandle& paths,
                          const MomentumHandle& model, Floats center, Tensor inertia,
                          Floats probabilities) {
    const Symmetric<double> tensor{inertia(0, 0), inertia(1, 1), inertia(2, 2),
                                   inertia(0, 1), inertia(1, 2), inertia(2, 0)};
    return array(throw_probabilities({*hull, *paths}, *model, vector(center), tensor, probabilities.data()));
}

// Gradients (r, 3 n), (r, 3) and (r, k) of weighted sums (r, k) of the probabilities of a uniform solid, in
// the vertices, the center of mass and the probabilities without momentum.
nb::tuple thrown_gradients(const HullHandle& hull, const PathsHandle& paths,
                           const MomentumHandle& model, Floats center, Floats probabilities, Rows weights) {
    const std::size_t count = weights.shape(0);
    const std::size_t coordinates = 3 * static_cast<std::size_t>(hull->vertex_count);
    std::vector<double> by_vertices(count * coordinates), by_center(count * 3),
        by_probabilities(count * probabilities.shape(0));
    pull_back_throw_probabilities({*hull, *paths}, *model, vector(center), probabilities.data(), weights.data(),
                          count, by_vertices.data(), by_center.data(), by_probabilities.data());
    return nb::make_tuple(array(std::move(by_vertices), coordinates),
                          array(std::move(by_center), 3),
                          array(std::move(by_probabilities), probabilities.shape(0)));
}

// Tensor of inertia (3, 3) of the uniform solid over its mass.
nb::object inertia_of_solid(const HullHandle& hull) {
    const Symmetric<double> m = solid_inertia(*hull);
    return array(std::vector<double>{m[0], m[3], m[5], m[3], m[1], m[4], m[5], m[4], m[2]}, 3);
}

}  // namespace

void bind_throws(nb::module_& module) {
    module.def("rests_below", &rests_below);
    module.def("advance_throws", &advance_throws);
    nb::class_<MomentumHandle>(module, "Momentum")
        .def(nb::init<Floats, std::array<std::size_t, 2>, std::array<std::size_t, 2>,
                      std::array<double, 9>>());
    module.def("throw_probabilities", &probabilities_of_thrown);
    module.def("thrown_gradients", &thrown_gradients);
    module.def("solid_inertia", &inertia_of_solid);
}

}  // namespace dicedesign
