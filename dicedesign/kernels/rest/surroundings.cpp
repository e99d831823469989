#include "rest/surroundings.hpp"

namespace dicedesign {

Surroundings surroundings(const Hull& hull, const Vec& point) {
    const Vec* x = hull.vertices;
    Box box(x[0]);
    Vec total{0.0, 0.0, 0.0};
    for (Index i = 0; i < hull.vertex_count; ++i) {
        box.add(x[i]);
        total += x[i];
    }
    Surroundings found{0, 0.0, 0.0, 0.0, box.extent()};
    found.offset = box.reach((1.0 / static_cast<double>(hull.vertex_count)) * total);
    found.far = larger(largest(absolute(point)), box.magnitude());
    for (Index f = 0; f < hull.facet_count; ++f) {
        const double height = dot(x[hull.tail[hull.facet_start[f]]] - point, hull.normals[f]);
        if (f == 0 || height < found.height) {
            found.facet = f;
            found.height = height;
        }
    }
    return found;
}

}  // namespace dicedesign
