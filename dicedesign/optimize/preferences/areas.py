"""Equal areas of the outcomes' facets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.optimize.preferences.preference import PREFERENCES, BearingFacets, Preference

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["USUAL_RATIO", "area_residuals"]

USUAL_RATIO: Final = 0.7
"""Standard deviation of the logarithms of ordinary areas."""


def area_residuals(die: BearingFacets) -> Tensor:
    """Logarithms of the areas less their mean."""
    import torch

    logarithms = torch.log(die.rests.facet_areas[die.facets])
    return (logarithms - logarithms.mean()) / (USUAL_RATIO * np.sqrt(len(die.facets)))


PREFERENCES.register(
    Preference(
        name="areas",
        line="equal areas of the outcomes' facets",
        rank=4,
        residuals=area_residuals,
    )
)
