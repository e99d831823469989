"""The energies of dice design, each its own function.

`Clusters` says which rests count for which outcome. An outcome without a rest, or without a facet,
is never silent: the dice energy misses its whole target, and the barycenter, neighbor and stability
terms charge the largest value that one facet can have.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from dicedesign import kernels
from dicedesign.design.compiled_energy import CompiledEnergy
from dicedesign.design.differentiable import RestEvaluation
from dicedesign.design.energy_weights import EnergyWeights
from dicedesign.geometry.hull import ConvexHull
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = [
    "Clusters",
    "Energy",
    "barycenter_energy",
    "cluster",
    "coplanar_energy",
    "dice_energy",
    "dice_simple_energy",
    "neighbor_energy",
    "outcome_facets",
    "stability_energy",
    "total_energy",
    "updated_directions",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LARGEST_SQUARED_DISTANCE = 4.0
"""Between two unit vectors: what a cluster without a rest is charged."""

SMALLEST_MEAN: Final = 1e-3
"""Length of the sum of a region's maxima below which it is no longer stretched to length 1: maxima
that cancel have no mean direction, and near there the gradient would grow without bound."""


@dataclass(frozen=True)
class Clusters:
    """Which outcome each rest counts for.

    Attributes
    ----------
    of_rest: (r,) outcome of each rest.
    directions: (k, 3) the unit directions u_i of the outcomes.
    """

    of_rest: Integers
    directions: Floats

    def sums(self, probabilities: Tensor) -> Tensor:
        """(k,) summed probabilities (r,) of each cluster."""
        zeros = torch.zeros(len(self.directions), dtype=torch.float64)
        return zeros.index_add(0, torch.as_tensor(self.of_rest), probabilities)

    @property
    def empty(self) -> int:
        """Number of outcomes without a rest."""
        return len(self.directions) - len(np.unique(self.of_rest))


def cluster(rest_normals: Floats, directions: Floats) -> Clusters:
    """Give each rest (r, 3) to the nearest of the directions (k, 3) (section 3.2)."""
    return Clusters(np.argmax(rest_normals @ directions.T, axis=1), directions)


def updated_directions(rest_normals: Floats, clusters: Clusters) -> Floats:
    """(k, 3) the normalised means of the clusters' normals; an empty cluster keeps its direction
    (section 3.2)."""
    sums = np.zeros_like(clusters.directions)
    np.add.at(sums, clusters.of_rest, rest_normals)
    length = np.sqrt((sums * sums).sum(-1))[:, None]
    return np.where(length > 0.0, sums / np.where(length > 0.0, length, 1.0), clusters.directions)


def dice_simple_energy(probabilities: Tensor, assigned: Tensor) -> Tensor:
    """E_diceSimple (eq. 11): squared differences of each facet's probability (r,) from the one
    assigned to it (r,), which is 0 for facets without an outcome."""
    return ((probabilities - assigned) ** 2).sum()


def dice_energy(probabilities: Tensor, clusters: Clusters, target: Floats) -> Tensor:
    """E_dice (eq. 12): squared differences of the clusters' probabilities from the target (k,)."""
    wanted = torch.as_tensor(target, dtype=torch.float64)
    return ((clusters.sums(probabilities) - wanted) ** 2).sum()


def coplanar_energy(rest_normals: Tensor, clusters: Clusters) -> Tensor:
    """E_cl (eq. 13): squared distances of normals (r, 3), over ordered pairs within a cluster,
    which are 2 n times those from the mean of its n normals."""
    of_rest = torch.as_tensor(clusters.of_rest)
    counts = torch.bincount(of_rest, minlength=len(clusters.directions)).clamp_min(1)[:, None]
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    means = zeros.index_add(0, of_rest, rest_normals) / counts
    return (2.0 * counts[of_rest] * (rest_normals - means[of_rest]) ** 2).sum()


def barycenter_energy(rests: RestEvaluation, clusters: Clusters) -> Tensor:
    """E_bc (eq. 14): squared distances of rest normals from the barycenter of their cluster's
    region, which is the normalised mean of the maxima on the region's border."""
    paths = rests.paths
    sides = clusters.of_rest[paths.basins]
    borders = np.flatnonzero(sides[:, 0] != sides[:, 1])
    energy = LARGEST_SQUARED_DISTANCE * clusters.empty * torch.ones((), dtype=torch.float64)
    if len(borders) == 0:
        return energy
    branch = np.stack([2 * borders, 2 * borders + 1], axis=1)
    outcome = np.repeat(sides[borders].ravel(), 2)
    peak = np.repeat(paths.maxima[branch][:, None, :], 2, axis=1).ravel()
    outcome, peak = np.unique(np.stack([outcome, peak]), axis=1)
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    sums = zeros.index_add(0, torch.as_tensor(outcome), rests.vertex_directions(peak))
    lengths = torch.linalg.vector_norm(sums, dim=1, keepdim=True)
    barycenters = sums / lengths.clamp_min(SMALLEST_MEAN)
    bordered = np.isin(clusters.of_rest, outcome)
    own = barycenters[clusters.of_rest[bordered]]
    return energy + ((rests.rest_normals[bordered] - own) ** 2).sum()


def neighbor_energy(rests: RestEvaluation, clusters: Clusters, radius: float) -> Tensor:
    """E_nb (eq. 15): squared distances from u_i of all facet normals within `radius` of it; stable
    facets or not. An outcome without a facet nearby is charged the squared radius."""
    normals = rests.hull.normals
    squared = ((clusters.directions[:, None, :] - normals[None, :, :]) ** 2).sum(-1)
    outcome, facet = np.nonzero(squared < radius**2)
    alone = len(clusters.directions) - len(np.unique(outcome))
    offset = rests.facet_normals(facet) - torch.as_tensor(clusters.directions[outcome])
    return (offset**2).sum() + alone * radius**2


def stability_energy(rests: RestEvaluation, clusters: Clusters, margin: float) -> Tensor:
    """Keeps one facet for each outcome stable and all others unstable, by a margin.

    A facet of depth s (`RestEvaluation.facet_depths`) with an outcome pays
    `max(0, 1 - s / margin)^2`, another one the same with -s. Probabilities jump where a depth
    crosses zero; this wall in front of the jump is what lets a smooth method walk along it. Not in
    the paper.
    """
    depths = rests.facet_depths
    signs, least = _sides(rests.hull, clusters, depths.detach().numpy(), margin)
    return (torch.relu(1.0 - torch.as_tensor(signs) * depths / margin) ** 2).sum() + least


def _sides(
    hull: ConvexHull, clusters: Clusters, depths: Floats, margin: float
) -> tuple[Floats, float]:
    """1 for each facet (m,) with an outcome, -1 for others, and the charge for outcomes that have
    none."""
    signs = np.full(len(hull.normals), -1.0)
    wanted = outcome_facets(hull.normals, clusters.directions, depths)
    signs[wanted] = 1.0
    return signs, (len(clusters.directions) - len(wanted)) * (1.0 + 1.0 / margin) ** 2


def outcome_facets(normals: Floats, directions: Floats, depths: Floats) -> Integers:
    """(k,) distinct facets, of normals (m, 3), that bear the outcomes of directions (k, 3).

    They lie nearest to the directions as a whole (least sum of cosines lost). Of facets that all
    lie within `SAME_REST_ANGLE` of a direction, as the parts of a facet that broke in two, the one
    of largest depth (m,) bears it: where two are equally deep they can change places and the
    stability energy is the same. With m < k facets, those of the m outcomes that get one.
    """
    cosines = directions @ normals.T
    within = cosines > np.cos(SAME_REST_ANGLE)
    # Being within the angle is worth at least 2, more than any cosine.
    gain = np.where(within, 3.0 + np.clip(depths, -1.0, 1.0), cosines)
    return np.asarray(linear_sum_assignment(-gain)[1], dtype=np.int64)


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
            walls = self.rests.depth_gradient(self._compiled.module, slopes)
            by_vertices, by_center = by_vertices + walls[0], by_center + walls[1]
        return self.rests.with_center(by_vertices, by_center)

    @cached_property
    def _tensors(self) -> dict[str, Tensor]:
        return total_energy(self.rests, self.clusters, self.target, self.weights)

    @cached_property
    def _compiled(self) -> CompiledEnergy | None:
        if kernels.compiled is None:
            return None
        return CompiledEnergy(
            kernels.compiled,
            self.rests,
            of_rest=self.clusters.of_rest,
            directions=self.clusters.directions,
            target=np.asarray(self.target, dtype=np.float64),
            weights=self.weights,
            smallest_mean=SMALLEST_MEAN,
        )

    @cached_property
    def _wall(self) -> tuple[float, Floats]:
        """The stability energy and its derivative (m,) in each facet's depth."""
        margin, depths = self.weights.stability_margin, self.rests.depths
        signs, least = _sides(self.rests.hull, self.clusters, depths, margin)
        lacking = np.maximum(1.0 - signs * depths / margin, 0.0)
        return float(lacking @ lacking) + least, -2.0 / margin * signs * lacking
