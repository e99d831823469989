// The compiled kernels as a Python module.
#include <cstdlib>

#include "arrays.hpp"

namespace dicedesign {
void bind_hull(nb::module_& module);
void bind_surface(nb::module_& module);
void bind_rest(nb::module_& module);
void bind_gradients(nb::module_& module);
void bind_throws(nb::module_& module);
namespace {

// The allocator of glibc hands large blocks back to the system as soon as they are freed, and pages
// that come anew from there cost as much as a hull of 1000 points. It holds on to blocks as large
// as the largest that was ever freed. Elsewhere this does nothing.
void hold_on_to_memory() {
    void* volatile block = std::malloc(std::size_t{16} << 20);
    std::free(block);
}

}  // namespace
}  // namespace dicedesign

NB_MODULE(dicedesign_kernels, module) {
    module.doc() = "Compiled inner loops of dicedesign; see dicedesign/kernels/ops.py.";
    module.attr("INTERFACE") = 7;
    // What torch still holds when Python ends is nobody's loss.
    nanobind::set_leak_warnings(false);
    dicedesign::hold_on_to_memory();
    dicedesign::bind_hull(module);
    dicedesign::bind_surface(module);
    dicedesign::bind_rest(module);
    dicedesign::bind_gradients(module);
    dicedesign::bind_throws(module);
}
