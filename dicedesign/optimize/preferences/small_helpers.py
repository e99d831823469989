"""Little area on facets without an outcome."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["USUAL_HELPERS", "helper_residuals"]

USUAL_HELPERS: Final = 0.2
"""Part of an ordinary die's surface that bears no outcome."""


def helper_residuals(die: BearingFacets) -> Tensor:
    """The part of the surface that bears no outcome."""
    areas = die.rests.facet_areas
    return (1.0 - areas[die.facets].sum() / areas.sum())[None] / USUAL_HELPERS


PREFERENCES.register(
    Preference(
        name="small_helpers",
        line="little area on facets without an outcome",
        rank=5,
        residuals=helper_residuals,
    )
)
