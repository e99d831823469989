"""The networks of the momentum model."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

from dicedesign.runtime.arrays import Floats

__all__ = ["LEAST_DEVIATION", "Network"]

LEAST_DEVIATION: Final = 1e-9
"""Of a feature: finer is rounding."""


@dataclass(frozen=True)
class Network:
    """A linear map plus one hidden layer of hyperbolic tangents, of features that are brought to
    mean 0 and standard deviation 1 first.

    Attributes
    ----------
    mean, deviation: (d,); linear: (d, o); bias: (o,); inward: (d, h); shift: (h,);
    outward: (h, o). Deviations are `LEAST_DEVIATION` to 1000, all others -1000 to 1000. Bias and
    shift may be (n, o) and (n, h), for each of the features (n, d) that it is asked about.
    """

    mean: Any
    deviation: Any
    linear: Any
    bias: Any
    inward: Any
    shift: Any
    outward: Any

    def __call__(self, features: Any, xp: ModuleType) -> Any:
        """Outputs (n, o) for features (n, d)."""
        scaled = (features - self.mean) / self.deviation
        hidden = xp.tanh(scaled @ self.inward + self.shift)
        return scaled @ self.linear + self.bias + hidden @ self.outward

    def unscaled(self) -> tuple[Floats, ...]:
        """The maps and their constants, of NumPy, that take features as they are."""
        linear, inward = (part / self.deviation[:, None] for part in (self.linear, self.inward))
        bias, shift = self.bias - self.mean @ linear, self.shift - self.mean @ inward
        return linear, bias, inward, shift, self.outward
