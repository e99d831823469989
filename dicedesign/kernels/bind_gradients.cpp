#include "arrays.hpp"

namespace dicedesign {
void bind_gradients(nb::module_& module) { (void)module; }
}  // namespace dicedesign
