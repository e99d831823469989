"""Options of `method: paper`, apart from the method, so that a recipe loads none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.optimize.options import (
    FINEST_TOLERANCE,
    SobolevOptions,
    legible,
    refused,
    require_choice,
)
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.runtime.numbers import Number
from dicedesign.runtime.registry import STRICT

__all__ = ["PaperOptions", "PaperWeights"]

SOLID_ANGLE: Final = (4.0 * np.pi) ** 2
"""By this the dice energy in solid angles, the unit of published weights, is larger than that in
probabilities (eq. 12)."""


class PaperWeights(EnergyWeights):
    """Weights beside a dice energy in solid angles, `sum_i (A_i - 4 pi q_i)^2`, as published ones
    are; see `TERMS` for the terms.

    The defaults lead every published target to its odds from most starts; "apart" is not in the
    paper. Raises InputError for a number out of range.
    """

    __slots__ = ()

    @classmethod
    def declared(cls) -> Mapping[str, Number]:
        """Those of all terms, with defaults of their own."""
        defaults = {
            "coplanar": 2.0,
            "barycenter": 0.1,
            "neighbor": 2.0,
            "neighbor_radius": 0.1,
            "stability": 0.0,
            "apart": 0.15,
        }
        return {
            name: replace(number, default=defaults.get(name, number.default))
            for name, number in super().declared().items()
        }

    @property
    def of_probabilities(self) -> EnergyWeights:
        """The same energy, but for a factor, with the dice energy of eq. 12."""
        return EnergyWeights(**self.as_dict()).times(1.0 / SOLID_ANGLE)


@dataclass(frozen=True)
class PaperOptions:
    """Options of `method: paper`.

    Attributes
    ----------
    weights: of the terms beside the dice energy, fixed, in the published unit (`PaperWeights`).
    sobolev: preconditioning of the gradient, or None.
    step: "momentum", which takes steps of a length that only shrinks with time, over jumps of the
        energy too; or "line_search", the paper's, which stops in front of a jump.
    steps: most steps, at least 0, refused ones included with momentum; then a line search from the
        best goes on for as many, or 300 if that is fewer.
    perturbation: standard deviation of the seeded noise on the vertices of the start, whose half
        extent is 1; from 0 on and below 1.
    finish: "exact" puts one facet in the place of each outcome's and goes on to the target by the
        exact method; "none" ends where the paper does.
    tolerance: largest |p - q| wanted, from `FINEST_TOLERANCE` on and below 1; None for 1e-12 with
        an exact finish and 2e-2 without.
    prefer: what the die is made better by after an exact finish; see `ExactOptions`. Robustness is
        of thrown dice alone.
    """

    __pydantic_config__ = STRICT

    weights: PaperWeights = field(default_factory=PaperWeights)
    sobolev: SobolevOptions | None = None
    step: Literal["momentum", "line_search"] = "momentum"
    steps: int = 600
    perturbation: float = 1e-3
    finish: Literal["exact", "none"] = "exact"
    tolerance: float | None = None
    prefer: Preferences = field(default_factory=legible)

    def __post_init__(self) -> None:
        require_choice("step", self.step, "momentum", "line_search")
        require_choice("finish", self.finish, "exact", "none")
        if self.steps < 0:
            raise refused("steps", "a whole number not below 0", self.steps, "600")
        if not 0.0 <= self.perturbation < 1.0:
            raise refused("perturbation", "a number in [0, 1)", self.perturbation, "1e-3")
        if self.tolerance is not None and not FINEST_TOLERANCE <= self.tolerance < 1.0:
            expected = f"a number from {FINEST_TOLERANCE:g} on and below 1"
            raise refused("tolerance", expected, self.tolerance, "1e-12, or 2e-2 without a finish")

    @property
    def reached(self) -> float:
        """Largest |p - q| that counts as reached."""
        if self.tolerance is not None:
            return self.tolerance
        return 1e-12 if self.finish == "exact" else 2e-2
