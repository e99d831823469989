"""Large circles in the outcomes' facets, for large labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["CIRCLE_POWER", "USUAL_CIRCLE", "circle_residuals"]

CIRCLE_POWER: Final = 4.0
"""Power of a circle's residual in the inverse of its radius: the larger, the more it is the
smallest circle alone that counts."""

USUAL_CIRCLE: Final = 0.5
"""Radius of an ordinary circle, in units of the diameter over the root of the number of outcomes:
that of the caps that as many equal parts of a sphere are."""


def circle_residuals(die: BearingFacets) -> Tensor:
    """Shares of the squared high-power mean of the inverse radii."""
    from dicedesign.gradient.inscribed_circles import soft_circle_radii

    count = len(die.facets)
    inverse = USUAL_CIRCLE / (np.sqrt(count) * soft_circle_radii(die.rests, die.facets))
    mean = (inverse ** (2.0 * CIRCLE_POWER)).mean()
    return inverse**CIRCLE_POWER * mean ** (0.5 / CIRCLE_POWER - 0.5) / np.sqrt(count)


PREFERENCES.register(
    Preference(
        name="circles",
        line="large circles in the facets of the outcomes, for large labels; the smallest counts "
        "most",
        rank=0,
        residuals=circle_residuals,
    )
)
