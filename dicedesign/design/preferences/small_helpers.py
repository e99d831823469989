"""Little area on facets without an outcome."""

from __future__ import annotations

from typing import Final

from torch import Tensor

from dicedesign.design.preferences.areas import _all_areas
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Integers

USUAL_HELPERS: Final = 0.2
"""Part of an ordinary die's surface that bears no outcome."""


def _small_helpers(rests: RestEvaluation, facets: Integers) -> Tensor:
    """The part of the surface that bears no outcome."""
    areas = _all_areas(rests)
    return (1.0 - areas[facets].sum() / areas.sum())[None] / USUAL_HELPERS
