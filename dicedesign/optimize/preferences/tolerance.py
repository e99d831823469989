"""Odds that a print whose facets are a little off keeps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["OFF", "USUAL_SLOPE", "tolerance_residuals"]

OFF: Final = 1.0 / 300.0
"""Distance over the diameter by which facets are off: 0.1 mm of an ordinary die."""

USUAL_SLOPE: Final = 2.0
"""Root of the summed squares of the slopes of an ordinary die's odds in the offsets of its facets,
in units of the diameter."""


def tolerance_residuals(die: BearingFacets) -> Tensor:
    """(m,) slope of all odds in the offset of each facet. Where these are independent and of one
    standard deviation, the sum of squares is in proportion to the summed variance of the odds."""
    import torch

    from dicedesign.gradient.facet_offsets import offset_secants
    from dicedesign.gradient.inscribed_circles import soft_diameter

    diameter = soft_diameter(die.rests)
    secants = offset_secants(die.rests, die.model, OFF * diameter)
    return torch.linalg.vector_norm(secants, dim=0) * diameter / USUAL_SLOPE


PREFERENCES.register(
    Preference(
        name="tolerance",
        line="odds that change little where facets come out of the printer a little off",
        rank=8,
        residuals=tolerance_residuals,
    )
)
