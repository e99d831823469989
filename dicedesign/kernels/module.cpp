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

// The allocator of glibc returns large blocks to the system as soon as they are freed, and getting
// fresh pages costs as much as a hull of 1000 points. It keeps blocks up to the size of the largest
// that was ever freed, so one is freed here. With other allocators this does nothing.
void hold_on_to_memory() {
    void* volatile block = std::malloc(std::size_t{16} << 20);
    std::free(block);
}

}  // namespace
}  // namespace dicedesign

NB_MODULE(dicedesign_kernels, module) {
    module.doc() = "Compiled inner loops of dicedesign; see dicedesign/kernels/ops.py.";
    module.attr("INTERFACE") = 10;
    // What torch still holds when Python ends is nobody's loss.
    nanobind::set_leak_warnings(false);
    dicedesign::hold_on_to_memory();
    dicedesign::bind_hull(module);
    dicedesign::bind_surface(module);
    dicedesign::bind_rest(module);
    dicedesign::bind_gradients(module);
    dicedesign::bind_throws(module);
}
