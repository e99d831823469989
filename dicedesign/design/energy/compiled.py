"""The energy of the paper by compiled kernels, with a hand-derived gradient."""

from __future__ import annotations

from types import ModuleType
from typing import Final

from dicedesign.design.energy.weights import EnergyWeights
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["PAPER_TERMS", "CompiledEnergy"]

PAPER_TERMS: Final = ("dice", "coplanar", "barycenter", "neighbor")
"""Names of the terms of eq. 16, in the order of the kernels."""


class CompiledEnergy:
    """The weighted terms of eq. 16 of one body.

    Attributes
    ----------
    module: the compiled kernels.
    terms: by name, those that have a weight.
    """

    def __init__(
        self,
        module: ModuleType,
        rests: RestEvaluation,
        *,
        of_rest: Integers,
        directions: Floats,
        target: Floats,
        weights: EnergyWeights,
        smallest_mean: float,
    ) -> None:
        """rests: the body; of_rest: (r,) outcome of each rest; directions: (k, 3) of the outcomes;
        target: (k,) their odds; smallest_mean: length of the sum of a region's maxima below which
        it is not stretched to 1."""
        hull, paths = rests.hull, rests.paths
        of_terms = weights.of_terms
        self.module = module
        self._weights = [of_terms.get(name, 0.0) for name in PAPER_TERMS]
        self._energies = module.Energies(
            *paths.branches,
            paths.rests,
            hull.facet_start,
            hull.tail,
            hull.vertices,
            rests.equilibria.center_of_mass,
            hull.normals,
            rests.odds,
            of_rest,
            directions,
            target,
            weights.neighbor_radius,
            smallest_mean,
            [name in of_terms for name in PAPER_TERMS],
        )
        values = dict(zip(PAPER_TERMS, self._energies.values(), strict=True))
        self.terms: dict[str, float] = {
            name: of_terms[name] * value for name, value in values.items() if name in of_terms
        }

    def gradient(self) -> tuple[Floats, Floats]:
        """That of their sum, in the vertices (n, 3) and in the center of mass (3,)."""
        found: tuple[Floats, Floats] = self._energies.gradient(self._weights)
        return found
