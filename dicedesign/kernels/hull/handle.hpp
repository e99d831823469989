// A hull of Python as all kernels take it.
#pragma once

#include "arrays.hpp"
#include "hull/hull.hpp"

namespace dicedesign {

inline Polyhedron polyhedron_of(const Points& vertices, const Indices& facet_start,
                                const Indices& tail, const Indices& twin) {
    return {rows(vertices),     static_cast<Index>(vertices.shape(0)),
            facet_start.data(), static_cast<Index>(facet_start.shape(0)) - 1,
            tail.data(),        twin.data()};
}

// Borrows the arrays of a `ConvexHull`, once for all kernels that are asked about it.
class HullHandle {
public:
    HullHandle(Points vertices, Indices facet_start, Indices tail, Indices twin, Indices head,
               Indices facet, Indices next, Indices previous, Indices outgoing_start,
               Indices outgoing, Points normals, Floats areas)
        : points_{vertices, normals},
          indices_{facet_start, tail, twin, head, facet, next, previous, outgoing_start, outgoing},
          areas_{areas},
          hull_{polyhedron_of(vertices, facet_start, tail, twin), head.data(), facet.data(),
                next.data(), previous.data(), outgoing_start.data(), outgoing.data(),
                rows(normals), areas.data()} {}

    // Of arrays that were made here; `owners` keep them.
    HullHandle(const Hull& hull, std::vector<nb::object>&& owners)
        : owners_(std::move(owners)), hull_(hull) {}

    const Hull& operator*() const { return hull_; }
    const Hull* operator->() const { return &hull_; }

private:
    // What the hull points into.
    std::vector<Points> points_;
    std::vector<Indices> indices_;
    std::vector<Floats> areas_;
    std::vector<nb::object> owners_;
    Hull hull_;
};

}  // namespace dicedesign
