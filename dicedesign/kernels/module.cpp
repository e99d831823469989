// The compiled kernels as a Python module.
#include "arrays.hpp"

namespace dicedesign {
void bind_hull(nb::module_& module);
void bind_surface(nb::module_& module);
void bind_rest(nb::module_& module);
void bind_gradients(nb::module_& module);
}  // namespace dicedesign

NB_MODULE(dicedesign_kernels, module) {
    module.doc() = "Compiled inner loops of dicedesign; see dicedesign.kernels.";
    module.attr("INTERFACE") = 1;
    dicedesign::bind_hull(module);
    dicedesign::bind_surface(module);
    dicedesign::bind_rest(module);
    dicedesign::bind_gradients(module);
}
