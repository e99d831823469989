"""The energy of the paper by compiled kernels, with a hand-derived gradient."""

from __future__ import annotations

from typing import Final

from dicedesign.design.energy.weights import EnergyWeights
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["PAPER_TERMS", "CompiledEnergy"]

PAPER_TERMS: Final = ("dice", "coplanar", "barycenter", "neighbor")
"""Names of the terms of eq. 16, in the order of the kernels."""


class CompiledEnergy:
    """The weighted terms of eq. 16 of one body.

    Attributes
    ----------
    terms: by name, those that have a weight.
    """

    def __init__(
        self,
        rests: RestEvaluation,
        *,
        of_rest: Integers,
        directions: Floats,
        target: Floats,
        weights: EnergyWeights,
        smallest_mean: float,
        no_rest: float,
    ) -> None:
        """rests: the body; of_rest: (r,) outcome of each rest; directions: (k, 3) of the outcomes;
        target: (k,) their odds; smallest_mean, no_rest: see
        `dicedesign.kernels.ops.energies`."""
        of_terms = weights.of_terms
        self._weights = [of_terms.get(name, 0.0) for name in PAPER_TERMS]
        energies = kernels.energies(
            rests.hull,
            rests.paths,
            rests.equilibria.center_of_mass,
            odds=rests.odds,
            of_rest=of_rest,
            directions=directions,
            target=target,
            neighbor_radius=weights.neighbor_radius,
            smallest_mean=smallest_mean,
            no_rest=no_rest,
            wanted=[name in of_terms for name in PAPER_TERMS],
        )
        assert energies is not None, "asked for where there are kernels only"
        self._energies = energies
        values = dict(zip(PAPER_TERMS, self._energies.values(), strict=True))
        self.terms: dict[str, float] = {
            name: of_terms[name] * value for name, value in values.items() if name in of_terms
        }

    def gradient(self) -> tuple[Floats, Floats]:
        """That of their sum, in the vertices (n, 3) and in the center of mass (3,)."""
        return self._energies.gradient(self._weights)
