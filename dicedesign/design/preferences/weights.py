"""What one may care about among dice of the same odds, as residuals with weights."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from torch import Tensor

from dicedesign.design.preferences.areas import _areas
from dicedesign.design.preferences.asymmetry import _asymmetry
from dicedesign.design.preferences.circles import _circles
from dicedesign.design.preferences.margin import _margin
from dicedesign.design.preferences.roundness import _roundness
from dicedesign.design.preferences.small_helpers import _small_helpers
from dicedesign.errors import InputError
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.gradient.restitution_sensitivity import Swing
from dicedesign.runtime.arrays import Integers
from dicedesign.runtime.registry import STRICT

__all__ = ["Preferences", "preference_residuals"]

LARGEST_WEIGHT: Final = 1e6
"""Beyond it the other terms are lost in rounding."""


@dataclass(frozen=True)
class Preferences:
    """Weights of what is made better while the odds are kept; 0 leaves one out. Only their ratios
    matter.

    Each multiplies a sum of squares that is about 1 for an ordinary die.

    Attributes
    ----------
    circles: large circles in the facets of the outcomes, for large labels; the smallest counts
        most.
    margin: normals of the outcomes' facets near the barycenters of their basins (eq. 14).
    asymmetry: both rests beside a saddle equally far from it (eq. 20, 21).
    roundness: all facets equally far from the center of mass, and all vertices.
    areas: equal areas of the outcomes' facets.
    small_helpers: little area on facets without an outcome.
    robustness: thrown odds that are the same on a table that is a little livelier or duller; those
        without momentum always are.
    nearness: parameters near those of the die that is made better.
    """

    __pydantic_config__ = STRICT

    circles: float = 0.0
    margin: float = 0.0
    asymmetry: float = 0.0
    roundness: float = 0.0
    areas: float = 0.0
    small_helpers: float = 0.0
    robustness: float = 0.0
    nearness: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 <= value <= LARGEST_WEIGHT:
                raise InputError(
                    f"{item.name}: expected a number from 0 to {LARGEST_WEIGHT:g}, got "
                    f"{value:g}; 0 leaves it out"
                )

    @property
    def largest(self) -> float:
        """The largest weight."""
        return max(getattr(self, item.name) for item in fields(self))

    @property
    def any(self) -> bool:
        """Whether anything is preferred."""
        return self.largest > 0.0


def preference_residuals(
    rests: RestEvaluation,
    facets: Integers,
    preferences: Preferences,
    swing: Swing | None = None,
) -> list[Tensor]:
    """Residuals of each term, whose sum of squares is the weighted sum of all but `nearness`.

    They do not depend on the die's size. Derivatives of the odds themselves are left out: they are
    meant for directions that change no odds.

    rests: the die; facets: (k,) facet of each outcome; preferences: the weights; swing: of its odds
    when thrown, or None for odds without momentum.
    """
    terms = dict(_TERMS)
    if swing is not None:
        terms["robustness"] = swing.residuals
    weights = {name: getattr(preferences, name) for name in terms}
    return [
        np.sqrt(weight) * terms[name](rests, facets)
        for name, weight in weights.items()
        if weight > 0.0
    ]


_TERMS: Final[dict[str, Callable[[RestEvaluation, Integers], Tensor]]] = {
    "circles": _circles,
    "margin": _margin,
    "asymmetry": _asymmetry,
    "roundness": _roundness,
    "areas": _areas,
    "small_helpers": _small_helpers,
}
