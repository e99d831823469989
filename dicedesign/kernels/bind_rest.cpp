#include "arrays.hpp"

namespace dicedesign {
void bind_rest(nb::module_& module) { (void)module; }
}  // namespace dicedesign
