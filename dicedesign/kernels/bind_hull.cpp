#include "arrays.hpp"

namespace dicedesign {
void bind_hull(nb::module_& module) { (void)module; }
}  // namespace dicedesign
