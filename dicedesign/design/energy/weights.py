"""The weights of the energy's terms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.registry import STRICT

__all__ = ["REGULARIZERS", "EnergyWeights"]

REGULARIZERS: Final = ("coplanar", "barycenter", "neighbor", "stability")
"""Names of the terms beside the dice energy."""


@dataclass(frozen=True)
class EnergyWeights:
    """Weights of the regularizers in eq. 16; a term with weight 0 is not evaluated.

    Attributes
    ----------
    coplanar: lambda_cl of eq. 13, not negative.
    barycenter: lambda_bc of eq. 14, not negative.
    neighbor: lambda_nb of eq. 15, not negative.
    neighbor_radius: chord length epsilon of the ball B_epsilon(u_i) in eq. 15, positive.
    stability: weight of `stability_energy`, not negative; 0 is the paper's energy.
    stability_margin: distance of a facet from the edge of (in)stability, relative to the
        circumscribed radius, below which `stability_energy` acts; above 0 and at most 1.
    """

    __pydantic_config__ = STRICT

    coplanar: float = 0.1
    barycenter: float = 2.0
    neighbor: float = 0.1
    neighbor_radius: float = 0.2
    stability: float = 0.1
    stability_margin: float = 0.05

    def __post_init__(self) -> None:
        for name in REGULARIZERS:
            value = getattr(self, name)
            if not 0.0 <= value < np.inf:
                raise InputError(
                    f"weights.{name}: expected a number not below 0, got {value:g}; 0 leaves the "
                    "term out"
                )
        if not 0.0 < self.neighbor_radius <= 2.0:
            raise InputError(
                "weights.neighbor_radius: expected a chord length above 0 and at most 2, got "
                f"{self.neighbor_radius:g}; leave it out for 0.2"
            )
        if not 0.0 < self.stability_margin <= 1.0:
            raise InputError(
                "weights.stability_margin: expected a fraction above 0 and at most 1, got "
                f"{self.stability_margin:g}; leave it out for 0.05"
            )

    @property
    def of_terms(self) -> dict[str, float]:
        """By the names of the terms that have a weight; that of the dice energy is 1."""
        weights = {"dice": 1.0}
        for name in REGULARIZERS:
            if (weight := getattr(self, name)) > 0.0:
                weights[name] = weight
        return weights

    def relaxed(self, factor: float) -> EnergyWeights:
        """The same with the barycenter and neighbor terms times a factor. Those two pull away from
        the target; the coplanar and stability terms vanish on a finished die and stay."""
        return replace(self, barycenter=self.barycenter * factor, neighbor=self.neighbor * factor)

    def narrowed(self, factor: float) -> EnergyWeights:
        """The same with the stability margin times a factor. A basin holds at least the circle of
        that radius about its rest, so that small probabilities need small margins."""
        return replace(self, stability_margin=self.stability_margin * factor)
