// Kernels of `dicedesign.geometry` for triangle surfaces. Triangles are (t, 3) indices from 0 that
// are below the number of points.
#include "arrays.hpp"
#include "surface.hpp"

namespace dicedesign {
namespace {

using Triangles = nb::ndarray<const Index, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

bool closed(Triangles triangles, Index points) {
    return is_closed(triangles.data(), static_cast<Index>(triangles.shape(0)), points);
}

nb::object shell_numbers(Triangles triangles, Index points) {
    return array(shells(triangles.data(), static_cast<Index>(triangles.shape(0)), points));
}

}  // namespace

void bind_surface(nb::module_& module) {
    module.def("is_closed", &closed);
    module.def("shells", &shell_numbers);
}

}  // namespace dicedesign
