"""Thrown odds that stay what they are on other tables."""

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
from dicedesign.throws.tables import Table

__all__ = ["USUAL_SWING", "TableSensitivity"]

USUAL_SWING: Final = 0.021
"""Root of the summed squares of the odds' changes on another table, of an ordinary die: the mean
over the tables."""


@dataclass(frozen=True)
class TableSensitivity:
    """What the odds of a die shall be on other tables, and what is known of them.

    Attributes
    ----------
    thrown: the model of the table itself.
    tables: the others, n of them.
    wanted: (k,) odds of the outcomes, on all tables.
    bias: (n, k) logarithm of the odds on the others over those of the model; None for 0.
    """

    thrown: ThrownOdds
    tables: tuple[Table, ...]
    wanted: Floats
    bias: Floats | None = None

    @property
    def is_known(self) -> bool:
        """Whether the model knows of any change."""
        return self.thrown.model is not None and len(self.tables) > 0

    @cached_property
    def others(self) -> list[ThrownOdds]:
        """The models of the other tables."""
        return [self.thrown.onto(table) for table in self.tables]

    def residuals(self, rests: RestEvaluation, facets: Integers) -> Tensor:
        """(n k,) how far the odds on the other tables, less their bias, are from those wanted.

        facets: (k,) of the outcomes.
        """
        of_outcomes = np.searchsorted(rests.paths.rests, facets)
        bias = np.zeros((len(self.tables), len(facets))) if self.bias is None else self.bias
        parts = []
        for thrown, of_table in zip(self.others, bias, strict=True):
            odds = thrown.tensor(rests)[of_outcomes] * torch.as_tensor(np.exp(of_table))
            parts.append(odds / odds.sum() - torch.as_tensor(self.wanted))
        return torch.cat(parts) / (USUAL_SWING * len(parts) ** 0.5)
