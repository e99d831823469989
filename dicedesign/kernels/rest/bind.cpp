// Kernels of `dicedesign.rest`.

#include "arrays.hpp"
#include "hull/handle.hpp"
#include "rest/lines.hpp"
#include "rest/morse.hpp"
#include "rest/paths.hpp"
#include "rest/surroundings.hpp"

namespace dicedesign {
namespace {

// The lengths that `Surroundings` of Python has, in order.
nb::tuple surroundings_of(const HullHandle& hull, Floats point) {
    const Surroundings found = surroundings(*hull, vector(point));
    return nb::make_tuple(found.facet, found.height, found.offset, found.far, found.extent);
}

// What Python gets instead of an answer: False where the body is tied, None where rounding could
// change the answer.
nb::object no_answer(Verdict verdict) {
    return verdict == Verdict::tied ? nb::object(nb::bool_(false)) : nb::object(nb::none());
}

// The arrays of a `Separatrices`, its handle, and the signs of the half-edges.
nb::object separatrices(const HullHandle& hull, Floats center, double rounding,
                        double tie_distance) {
    Elements elements;
    Separatrices found;
    const Verdict verdict =
        find_separatrices(*hull, vector(center), {rounding, tie_distance}, elements, found);
    if (verdict != Verdict::certain) return no_answer(verdict);
    const Paths paths{static_cast<Index>(found.rests.size()),
                      static_cast<Index>(found.saddles.size()),
                      found.rests.data(),
                      found.basins.data(),
                      found.saddle_ends.data(),
                      found.crossings.data(),
                      found.branch_start.data(),
                      found.maxima.data()};
    // A vector that is moved keeps its numbers where they are.
    const std::array<nb::object, 7> arrays = {
        array(std::move(found.rests)),          array(std::move(found.saddles)),
        array(std::move(found.basins), 2),      array(std::move(found.saddle_ends), 2),
        array(std::move(found.crossings), 2),   array(std::move(found.branch_start)),
        array(std::move(found.maxima))};
    const auto& [rests, saddles, basins, saddle_ends, crossings, branch_start, maxima] = arrays;
    return nb::make_tuple(
        rests, saddles, basins, saddle_ends, crossings, branch_start, maxima,
        nb::cast(PathsHandle(paths, {rests, basins, saddle_ends, crossings, branch_start, maxima})),
        array(std::move(elements.growth_sign)), array(std::move(elements.side_sign)));
}

// Where bodies come to rest that are let go on facets.
nb::object destinations(const HullHandle& hull, Floats center, double rounding,
                        double tie_distance, Indices facets) {
    std::vector<Index> reached;
    const Verdict verdict =
        find_destinations(*hull, vector(center), {rounding, tie_distance}, facets.data(),
                          static_cast<Index>(facets.shape(0)), reached);
    if (verdict != Verdict::certain) return no_answer(verdict);
    return array(std::move(reached));
}

// Facets that bodies tip onto which slide downhill, and whether that is certain.
nb::object slides(const HullHandle& hull, Floats center, double rounding, double tie_distance,
                  Indices cells, Points directions, Floats errors) {
    const Frame<double> frame(*hull, vector(center), {rounding, tie_distance});
    Elements elements;
    const Verdict verdict = classify(frame, elements);
    if (verdict != Verdict::certain) return no_answer(verdict);
    std::vector<Index> reached(cells.shape(0));
    std::vector<Index> certain(cells.shape(0));
    for (std::size_t i = 0; i < cells.shape(0); ++i) {
        certain[i] =
            slide(frame, elements, cells(i), rows(directions)[i], errors(i), reached[i]);
        if (reached[i] < 0) return nb::none();
    }
    return nb::make_tuple(array(std::move(reached)), array(std::move(certain)));
}

// Areas of the basins between separatrices; None where the basins do not cover the sphere to within
// a tolerance.
nb::object basin_areas(const HullHandle& hull, const PathsHandle& paths, Floats center,
                       double near_antipode, double closure) {
    if (paths->rests == 1) return array(std::vector<double>{4.0 * PI});
    std::vector<double> areas = signed_areas(*hull, *paths, vector(center), near_antipode);
    if (!close_areas(areas, closure)) return nb::none();
    return array(std::move(areas));
}

}  // namespace

void bind_rest(nb::module_& module) {
    nb::class_<PathsHandle>(module, "Paths")
        .def(nb::init<Indices, IndexPairs, IndexPairs, IndexPairs, Indices, Indices>());
    module.def("surroundings", &surroundings_of);
    module.def("separatrices", &separatrices);
    module.def("destinations", &destinations);
    module.def("slides", &slides);
    module.def("basin_areas", &basin_areas);
}

}  // namespace dicedesign
