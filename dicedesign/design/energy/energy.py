"""The energy of a shape: the weighted sum of terms (eq. 16), and its gradient.

An outcome without a rest, or without a facet, is never silent: the dice energy misses its whole
target, and the barycenter, neighbor and stability terms charge the largest value that one facet can
have.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from torch import Tensor

from dicedesign.design.energy.clusters import ClusteredRests
from dicedesign.design.energy.term import SMALLEST_MEAN, TERMS, EnergyWeights, Term
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats

__all__ = ["Energy", "energy_terms"]


def energy_terms(
    state: ClusteredRests, weights: EnergyWeights, names: Sequence[str] | None = None
) -> dict[str, Tensor]:
    """The weighted terms by name, by operations of torch; only those with a weight are evaluated.

    names: of terms, or None for all.
    """
    return {
        name: weight * TERMS[name].evaluate(state, weights)
        for name, weight in weights.of_terms.items()
        if names is None or name in names
    }


@dataclass(frozen=True)
class Energy:
    """The energy of a shape as numbers: by compiled kernels where there are any for a term, else by
    torch, all added.

    Attributes
    ----------
    state: the shape; weights: of the terms.
    """

    state: ClusteredRests
    weights: EnergyWeights

    @cached_property
    def terms(self) -> dict[str, float]:
        """The weighted terms by name, those of `energy_terms`."""
        values = {name: term.item() for name, term in self._in_torch.items()}
        weights = self.weights.of_terms
        if self._compiled is not None:
            together = self._compiled.values()
            for term in self._terms:
                if term.kernel is not None:
                    values[term.name] = weights[term.name] * together[term.kernel]
        for name, (value, _) in self._of_depths.items():
            values[name] = weights[name] * value
        return {name: values[name] for name in weights}

    @property
    def gradient(self) -> Floats:
        """(n, 3) that of their sum in the vertices of the hull, with which the center of mass of a
        uniform solid moves."""
        rests, weights = self.state.rests, self.weights.of_terms
        parts: list[Floats] = []
        if self._compiled is not None and kernels.compiled is not None:
            by_vertices, by_center = self._compiled.gradient(self._kernel_weights)
            for name, (_, slopes) in self._of_depths.items():
                walls = rests.depth_gradient(kernels.compiled, weights[name] * slopes)
                by_vertices, by_center = by_vertices + walls[0], by_center + walls[1]
            parts.append(rests.with_center(by_vertices, by_center))
        varying = [term for term in self._in_torch.values() if term.requires_grad]
        if varying:
            (gradient,) = torch.autograd.grad(varying, rests.vertices, retain_graph=True)
            parts.append(gradient.numpy())
        return sum(parts[1:], parts[0]) if parts else np.zeros_like(rests.hull.vertices)

    @property
    def _terms(self) -> list[Term]:
        return [TERMS[name] for name in self.weights.of_terms]

    @cached_property
    def _in_torch(self) -> dict[str, Tensor]:
        """Weighted terms for which there are no compiled kernels."""
        names = [
            term.name
            for term in self._terms
            if self._compiled is None or (term.kernel is None and term.of_depths is None)
        ]
        return energy_terms(self.state, self.weights, names)

    @cached_property
    def _of_depths(self) -> dict[str, tuple[float, Floats]]:
        """Value, and derivatives (m,) in the facets' depths, of terms of these alone."""
        if self._compiled is None:
            return {}
        return {
            term.name: term.of_depths(self.state, self.weights)
            for term in self._terms
            if term.of_depths is not None
        }

    @cached_property
    def _kernel_weights(self) -> list[float]:
        """Of the terms that the kernels evaluate together, in their order."""
        weights = self.weights.of_terms
        places = {term.kernel: term.name for term in TERMS if term.kernel is not None}
        return [weights.get(places[place], 0.0) for place in sorted(places)]

    @cached_property
    def _compiled(self) -> Any:
        """Terms that the kernels evaluate together, with a gradient derived by hand; None without
        kernels."""
        if kernels.compiled is None:
            return None
        rests, clusters = self.state.rests, self.state.clusters
        hull, paths = rests.hull, rests.paths
        return kernels.compiled.Energies(
            *paths.branches,
            paths.rests,
            hull.facet_start,
            hull.tail,
            hull.vertices,
            rests.equilibria.center_of_mass,
            hull.normals,
            rests.odds,
            clusters.of_rest,
            clusters.directions,
            np.asarray(self.state.target, dtype=np.float64),
            self.weights.neighbor_radius,
            SMALLEST_MEAN,
            [weight > 0.0 for weight in self._kernel_weights],
        )
