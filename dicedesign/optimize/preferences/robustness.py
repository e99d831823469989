"""Thrown odds that are the same on other tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["robustness_residuals"]


def robustness_residuals(die: BearingFacets) -> Tensor | None:
    """See `TableSensitivity.residuals`; None for odds without momentum."""
    if die.sensitivity is None:
        return None
    return die.sensitivity.residuals(die.rests, die.facets)


PREFERENCES.register(
    Preference(
        name="robustness",
        line="thrown odds that are the same on what the table may be instead; those without "
        "momentum always are",
        rank=6,
        residuals=robustness_residuals,
    )
)
