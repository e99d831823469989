"""Thrown odds that stay what they are on a table that is a little livelier or duller."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["CHANGES", "USUAL_SWING", "RestitutionSensitivity"]

CHANGES: Final = (0.2, -0.2)
"""Parts by which the restitution of a livelier and of a duller table is higher. Of all that makes a
throw it is what changes the odds most."""

USUAL_SWING: Final = 0.03
"""Root of the summed squares of the odds' changes on both, of an ordinary die."""


@dataclass(frozen=True)
class RestitutionSensitivity:
    """What the odds of a die shall be on the changed tables, and what is known of them.

    Attributes
    ----------
    thrown: the model of the table itself.
    wanted: (k,) odds of the outcomes, on all tables.
    bias: (2, k) logarithm of the odds on the changed tables over those of the model.
    """

    thrown: ThrownOdds
    wanted: Floats
    bias: Floats

    @property
    def is_known(self) -> bool:
        """Whether the model knows of any change: where nothing bounces, there is none."""
        model = self.thrown.model
        return model is not None and any(slope.any() for slope in vars(model[0].slopes).values())

    @cached_property
    def changed(self) -> list[ThrownOdds]:
        """The models of the changed tables."""
        return [self.thrown.at(change) for change in CHANGES]

    def residuals(self, rests: RestEvaluation, facets: Integers) -> Tensor:
        """(2 k,) how far the odds on the changed tables, less their bias, are from those wanted.

        facets: (k,) of the outcomes.
        """
        of_outcomes = np.searchsorted(rests.paths.rests, facets)
        parts = []
        for thrown, bias in zip(self.changed, self.bias, strict=True):
            odds = thrown.tensor(rests)[of_outcomes] * torch.as_tensor(np.exp(bias))
            parts.append(odds / odds.sum() - torch.as_tensor(self.wanted))
        return torch.cat(parts) / USUAL_SWING
