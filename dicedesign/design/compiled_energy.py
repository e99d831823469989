"""The energy of the paper by compiled kernels, with a hand-derived gradient."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.differentiable import RestEvaluation

__all__ = ["PAPER_TERMS", "CompiledEnergy"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

PAPER_TERMS: Final = ("dice", "coplanar", "barycenter", "neighbor")
"""Names of the terms of eq. 16."""


class CompiledEnergy:
    """The weighted terms of eq. 16 of one body.

    Attributes
    ----------
    values: (4,) the terms in the order of `PAPER_TERMS`; 0 where the weight is.
    """

    def __init__(
        self,
        compiled: ModuleType,
        rests: RestEvaluation,
        outcomes: tuple[Integers, Floats, Floats],
        weights: tuple[float, ...],
        lengths: tuple[float, float],
    ) -> None:
        """rests: the body; outcomes: that of each rest (r,), directions (k, 3), and what is wanted
        (k,); weights: (4,) of the terms; lengths: radius of the neighbor term, and of the sum of a
        region's maxima below which it is not stretched to 1."""
        hull, paths = rests.hull, rests.paths
        self._weights = weights
        self._energies = compiled.Energies(
            *paths.branches,
            paths.rests,
            hull.facet_start,
            hull.tail,
            hull.vertices,
            rests.equilibria.center_of_mass,
            hull.normals,
            rests.odds,
            *outcomes,
            *lengths,
            [weight > 0.0 for weight in weights],
        )
        self.values = self._weighted(self._energies.values())

    def gradient(self, slopes: Sequence[float]) -> tuple[Floats, Floats]:
        """That of a sum of the terms times slopes (4,), in the vertices (n, 3) and in the center of
        mass (3,)."""
        found: tuple[Floats, Floats] = self._energies.gradient(self._weighted(slopes))
        return found

    def _weighted(self, numbers: Sequence[float]) -> list[float]:
        return [weight * number for weight, number in zip(self._weights, numbers, strict=True)]
