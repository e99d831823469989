// Kernels of `dicedesign.rest`.

#include "arrays.hpp"
#include "lines.hpp"
#include "morse.hpp"

namespace dicedesign {
namespace {

// How far the facets lie from a point inside, and how large a body is: the number and the height
// of the lowest facet, the largest difference of a coordinate from the vertices' mean, the largest
// coordinate of vertices and point, and the largest extent.
nb::tuple surroundings(Points vertices, Indices facet_start, Indices tail, Points normals,
                       Floats point) {
    const Vec* x = rows(vertices);
    const Vec c = vector(point);
    const std::size_t count = vertices.shape(0);
    Box box(x[0]);
    Vec total{0.0, 0.0, 0.0};
    for (std::size_t i = 0; i < count; ++i) {
        box.add(x[i]);
        total += x[i];
    }
    const double offset = box.reach((1.0 / static_cast<double>(count)) * total);
    const double far = larger(largest(absolute(c)), box.magnitude());
    Index lowest = 0;
    double height = 0.0;
    for (std::size_t f = 0; f < normals.shape(0); ++f) {
        const double h = dot(x[tail(facet_start(f))] - c, rows(normals)[f]);
        if (f == 0 || h < height) {
            lowest = static_cast<Index>(f);
            height = h;
        }
    }
    return nb::make_tuple(lowest, height, offset, far, box.extent());
}

// A hull with its center of mass, and the tolerances, as Python passes them.
struct Body {
    Hull hull;
    Vec center;
    Tolerances tolerances;
};

Body body_of(const Points& vertices, const Indices& facet_start, const Indices& tail,
             const Indices& head, const Indices& twin, const Indices& facet, const Indices& next,
             const Indices& previous, const Indices& outgoing_start, const Indices& outgoing,
             const Points& normals, const Floats& areas, const Floats& center, double rounding,
             double tie_distance) {
    const Hull hull{static_cast<Index>(vertices.shape(0)),
                    static_cast<Index>(normals.shape(0)),
                    static_cast<Index>(tail.shape(0)),
                    rows(vertices),
                    facet_start.data(),
                    tail.data(),
                    head.data(),
                    twin.data(),
                    facet.data(),
                    next.data(),
                    previous.data(),
                    outgoing_start.data(),
                    outgoing.data(),
                    rows(normals),
                    areas.data()};
    return {hull, vector(center), Tolerances{rounding, tie_distance}};
}

// What Python gets instead of an answer: False where the body is tied, None where rounding could
// change the answer.
nb::object no_answer(Verdict verdict) {
    return verdict == Verdict::tied ? nb::object(nb::bool_(false)) : nb::object(nb::none());
}

// The separatrices of a hull, see `dicedesign.rest.compiled`.
nb::object separatrices(Points vertices, Indices facet_start, Indices tail, Indices head,
                        Indices twin, Indices facet, Indices next, Indices previous,
                        Indices outgoing_start, Indices outgoing, Points normals, Floats areas,
                        Floats center, double rounding, double tie_distance) {
    const Body body = body_of(vertices, facet_start, tail, head, twin, facet, next, previous,
                              outgoing_start, outgoing, normals, areas, center, rounding,
                              tie_distance);
    Elements elements;
    Separatrices found;
    const Verdict verdict =
        find_separatrices(body.hull, body.center, body.tolerances, elements, found);
    if (verdict != Verdict::certain) return no_answer(verdict);
    return nb::make_tuple(array(std::move(found.rests)), array(std::move(found.saddles)),
                          array(std::move(found.basins), 2),
                          array(std::move(found.saddle_ends), 2),
                          array(std::move(found.crossings), 2),
                          array(std::move(found.branch_start)), array(std::move(found.maxima)),
                          array(std::move(elements.growth_sign)),
                          array(std::move(elements.side_sign)));
}

// Where bodies come to rest that are let go on facets, see `dicedesign.rest.compiled`.
nb::object destinations(Points vertices, Indices facet_start, Indices tail, Indices head,
                        Indices twin, Indices facet, Indices next, Indices previous,
                        Indices outgoing_start, Indices outgoing, Points normals, Floats areas,
                        Floats center, double rounding, double tie_distance, Indices facets) {
    const Body body = body_of(vertices, facet_start, tail, head, twin, facet, next, previous,
                              outgoing_start, outgoing, normals, areas, center, rounding,
                              tie_distance);
    std::vector<Index> reached;
    const Verdict verdict =
        find_destinations(body.hull, body.center, body.tolerances, facets.data(),
                          static_cast<Index>(facets.shape(0)), reached);
    if (verdict != Verdict::certain) return no_answer(verdict);
    return array(std::move(reached));
}

// Facets that bodies tip onto which slide downhill, and whether that is certain, see
// `dicedesign.rest.compiled`.
nb::object slides(Points vertices, Indices facet_start, Indices tail, Indices head, Indices twin,
                  Indices facet, Indices next, Indices previous, Indices outgoing_start,
                  Indices outgoing, Points normals, Floats areas, Floats center, double rounding,
                  double tie_distance, Indices cells, Points directions, Floats errors) {
    const Body body = body_of(vertices, facet_start, tail, head, twin, facet, next, previous,
                              outgoing_start, outgoing, normals, areas, center, rounding,
                              tie_distance);
    const Frame<double> frame(body.hull, body.center, body.tolerances);
    const Frame<Twofold> finer(body.hull, body.center, body.tolerances);
    Elements elements;
    const Verdict verdict = classify(frame, finer, body.tolerances, elements);
    if (verdict != Verdict::certain) return no_answer(verdict);
    std::vector<Index> reached(cells.shape(0));
    std::vector<Index> certain(cells.shape(0));
    for (std::size_t i = 0; i < cells.shape(0); ++i) {
        certain[i] = slide(frame, body.tolerances, elements, cells(i), rows(directions)[i],
                           errors(i), reached[i]);
        if (reached[i] < 0) return nb::none();
    }
    return nb::make_tuple(array(std::move(reached)), array(std::move(certain)));
}

// Areas of the basins between separatrices, from the arrays of `Separatrices`; None where the
// basins do not cover the sphere to within a tolerance. The normals are those of all facets.
nb::object basin_areas(Indices rests, IndexPairs basins, IndexPairs saddle_ends,
                       IndexPairs crossings, Indices branch_start, Indices maxima,
                       Points vertices, Floats center, Points normals, double tolerance) {
    const std::size_t count = rests.shape(0);
    if (count == 1) return array(std::vector<double>{4.0 * PI});
    const Paths paths =
        paths_of(count, basins, saddle_ends, crossings, branch_start, maxima);
    std::vector<Vec> rest_normals;
    rest_normals.reserve(count);
    for (std::size_t i = 0; i < count; ++i) rest_normals.push_back(rows(normals)[rests(i)]);
    std::vector<double> areas = signed_areas(paths, rows(vertices),
                                             vector(center),
                                             rest_normals.data());
    if (!close_areas(areas, tolerance)) return nb::none();
    return array(std::move(areas));
}

}  // namespace

void bind_rest(nb::module_& module) {
    module.def("surroundings", &surroundings);
    module.def("separatrices", &separatrices);
    module.def("destinations", &destinations);
    module.def("slides", &slides);
    module.def("basin_areas", &basin_areas);
}

}  // namespace dicedesign
