"""The energies of dice design, each its own function.

`Clusters` says which rests count for which outcome. An outcome without a rest, or without a facet,
is never silent: the dice energy misses its whole target, and the barycenter, neighbor and stability
terms charge the largest value that one facet can have.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from dicedesign.design.energy.barycenter import (
    LARGEST_SQUARED_DISTANCE,
    SMALLEST_MEAN,
    barycenter_energy,
)
from dicedesign.design.energy.clusters import Clusters
from dicedesign.design.energy.compiled import CompiledEnergy
from dicedesign.design.energy.coplanar import coplanar_energy
from dicedesign.design.energy.dice import dice_energy
from dicedesign.design.energy.neighbor import neighbor_energy
from dicedesign.design.energy.stability import _sides, stability_energy
from dicedesign.design.energy.weights import EnergyWeights
from dicedesign.gradient.rest_odds import RestEvaluation
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats

__all__ = ["Energy", "total_energy"]


def total_energy(
    rests: RestEvaluation, clusters: Clusters, target: Floats, weights: EnergyWeights
) -> dict[str, Tensor]:
    """The weighted terms of eq. 16 by name, and that of the stability energy, by operations of
    torch; only those with a weight are evaluated."""
    terms = {
        "dice": lambda: dice_energy(rests.probabilities, clusters, target),
        "coplanar": lambda: coplanar_energy(rests.rest_normals, clusters),
        "barycenter": lambda: barycenter_energy(rests, clusters),
        "neighbor": lambda: neighbor_energy(rests, clusters, weights.neighbor_radius),
        "stability": lambda: stability_energy(rests, clusters, weights.stability_margin),
    }
    return {name: weight * terms[name]() for name, weight in weights.of_terms.items()}


@dataclass(frozen=True)
class Energy:
    """The energy of a body as numbers, by compiled kernels where there are any.

    Attributes
    ----------
    rests: the body; clusters, target (k,), weights: as in `total_energy`.
    """

    rests: RestEvaluation
    clusters: Clusters
    target: Floats
    weights: EnergyWeights

    @cached_property
    def terms(self) -> dict[str, float]:
        """The weighted terms by name, those of `total_energy`."""
        if self._compiled is None:
            return {name: term.item() for name, term in self._tensors.items()}
        terms = self._compiled.terms
        if "stability" in self.weights.of_terms:
            terms = {**terms, "stability": self.weights.stability * self._wall[0]}
        return terms

    @property
    def gradient(self) -> Floats:
        """(n, 3) that of their sum in the vertices of the hull, with which the center of mass of a
        uniform solid moves."""
        if self._compiled is None:
            terms = [term for term in self._tensors.values() if term.requires_grad]
            return torch.autograd.grad(terms, self.rests.vertices, retain_graph=True)[0].numpy()
        by_vertices, by_center = self._compiled.gradient()
        if "stability" in self.weights.of_terms:
            slopes = self.weights.stability * self._wall[1]
            walls = self.rests.depth_gradient(slopes)
            assert walls is not None, "kernels that have the energies have these"
            by_vertices, by_center = by_vertices + walls[0], by_center + walls[1]
        return self.rests.with_center(by_vertices, by_center)

    @cached_property
    def _tensors(self) -> dict[str, Tensor]:
        return total_energy(self.rests, self.clusters, self.target, self.weights)

    @cached_property
    def _compiled(self) -> CompiledEnergy | None:
        if not kernels.available():
            return None
        return CompiledEnergy(
            self.rests,
            of_rest=self.clusters.of_rest,
            directions=self.clusters.directions,
            target=np.asarray(self.target, dtype=np.float64),
            weights=self.weights,
            smallest_mean=SMALLEST_MEAN,
            no_rest=LARGEST_SQUARED_DISTANCE,
        )

    @cached_property
    def _wall(self) -> tuple[float, Floats]:
        """The stability energy and its derivative (m,) in each facet's depth."""
        margin, depths = self.weights.stability_margin, self.rests.depths
        signs, least = _sides(self.rests.hull, self.clusters, depths, margin)
        lacking = np.maximum(1.0 - signs * depths / margin, 0.0)
        return float(lacking @ lacking) + least, -2.0 / margin * signs * lacking
