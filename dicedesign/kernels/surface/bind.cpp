// Kernels for triangle surfaces: their shells, and pictures of them. Triangles are (t, 3) indices
// from 0 that are below the number of points.
#include "arrays.hpp"
#include "surface/raster.hpp"
#include "surface/surface.hpp"

namespace dicedesign {
namespace {

using Triangles = nb::ndarray<const Index, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

bool closed(Triangles triangles, Index points) {
    return is_closed(triangles.data(), static_cast<Index>(triangles.shape(0)), points);
}

nb::object shell_numbers(Triangles triangles, Index points) {
    return array(shells(triangles.data(), static_cast<Index>(triangles.shape(0)), points));
}

nb::tuple picture(Points positions, Triangles triangles, Index size) {
    std::vector<Index> seen;
    std::vector<double> depth;
    rasterize(rows(positions), triangles.data(), static_cast<Index>(triangles.shape(0)), size,
              seen, depth);
    return nb::make_tuple(array(std::move(seen), size), array(std::move(depth), size));
}

}  // namespace

void bind_surface(nb::module_& module) {
    module.def("is_closed", &closed);
    module.def("shells", &shell_numbers);
    module.def("rasterize", &picture);
}

}  // namespace dicedesign
