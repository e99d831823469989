"""Preferences among dice of the same odds, as residuals with weights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.runtime.registry import Extension, Number, Numbers, Registry

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.gradient.odds_model import OddsModel, TableSensitivity
    from dicedesign.gradient.rest_odds import RestEvaluation
    from dicedesign.runtime.arrays import Integers


LARGEST_WEIGHT: Final = 1e6
"""Beyond it the other terms are lost in rounding."""


@dataclass(frozen=True)
class BearingFacets:
    """A die with one rest for each outcome: what a preference sees.

    Attributes
    ----------
    rests: hull and rests; coordinates in torch are functions of its `vertices` (n, 3).
    facets: (k,) facet of each outcome.
    sensitivity: of its odds when thrown, or None for odds without momentum, the same on every
        table.
    model: of its odds, where it is thrown or let go under a prior; None for odds without momentum,
        with any side down alike.
    """

    rests: RestEvaluation
    facets: Integers
    sensitivity: TableSensitivity | None = None
    model: OddsModel | None = None


@dataclass(frozen=True, kw_only=True)
class Preference(Extension):
    """Something to care about.

    Attributes
    ----------
    residuals: vector whose sum of squares, about 1 for an ordinary die whatever its size, is made
        small, differentiable in the vertices; or None where there is nothing to ask. Derivatives of
        the odds without momentum may be left out: a die moves in directions that change none.
    """

    residuals: Callable[[BearingFacets], Tensor | None]


PREFERENCES: Final = Registry(
    "preference",
    Preference,
    builtin=(
        "dicedesign.optimize.preferences.built_in:CIRCLES",
        "dicedesign.optimize.preferences.built_in:MARGIN",
        "dicedesign.optimize.preferences.built_in:ASYMMETRY",
        "dicedesign.optimize.preferences.built_in:ROUNDNESS",
        "dicedesign.optimize.preferences.built_in:AREAS",
        "dicedesign.optimize.preferences.built_in:SMALL_HELPERS",
        "dicedesign.optimize.preferences.built_in:ROBUSTNESS",
        "dicedesign.optimize.preferences.built_in:NEARNESS",
        "dicedesign.optimize.preferences.built_in:TOLERANCE",
    ),
    group="dicedesign.preferences",
)


class Preferences(Numbers):
    """Weights of what is made better while the odds are kept; 0, unless given, leaves one out; see
    `PREFERENCES`. Only their ratios matter. Each multiplies a sum of squares that is about 1 for an
    ordinary die.

    Raises InputError for a weight out of range.
    """

    __slots__ = ()

    @classmethod
    def declared(cls) -> Mapping[str, Number]:
        """The weight of each preference."""
        return {
            preference.name: Number(
                name=preference.name,
                default=0.0,
                line=preference.line,
                expected=f"a number from 0 to {LARGEST_WEIGHT:g}",
                remedy="0 leaves it out",
                allows=lambda weight: 0.0 <= weight <= LARGEST_WEIGHT,
            )
            for preference in PREFERENCES
        }

    @property
    def largest(self) -> float:
        """The largest weight."""
        return max(getattr(self, name) for name in PREFERENCES.names)


def preference_residuals(die: BearingFacets, preferences: Preferences) -> list[Tensor]:
    """Residuals of each preference with a weight, whose sum of squares is the weighted sum of all
    but `nearness`, which is about parameters."""
    residuals = []
    for preference in PREFERENCES:
        weight = getattr(preferences, preference.name)
        own = preference.residuals(die) if weight > 0.0 else None
        if own is not None:
            residuals.append(np.sqrt(weight) * own)
    return residuals
