"""Large circles in the outcomes' facets, for large labels."""

from __future__ import annotations

from typing import Final

import numpy as np
from torch import Tensor

from dicedesign.gradient.inscribed_circles import soft_circle_radii
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Integers

CIRCLE_POWER: Final = 4.0
"""Power of a circle's residual in the inverse of its radius: the larger, the more it is the
smallest circle alone that counts."""

USUAL_CIRCLE: Final = 0.5
"""Radius of an ordinary circle, in units of the diameter over the root of the number of outcomes:
that of the caps that as many equal parts of a sphere are."""


def _circles(rests: RestEvaluation, facets: Integers) -> Tensor:
    """Shares of the squared high-power mean of the inverse radii."""
    count = len(facets)
    inverse = USUAL_CIRCLE / (np.sqrt(count) * soft_circle_radii(rests, facets))
    mean = (inverse ** (2.0 * CIRCLE_POWER)).mean()
    return inverse**CIRCLE_POWER * mean ** (0.5 / CIRCLE_POWER - 0.5) / np.sqrt(count)
