"""The energies of dice design, each its own function.

`Clusters` says which rests count for which outcome. An outcome without a rest, or without a facet,
is never silent: the dice energy misses its whole target, and the barycenter, neighbor and stability
terms charge the largest value that one facet can have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from dicedesign.design.differentiable import RestEvaluation
from dicedesign.errors import InputError
from dicedesign.options import STRICT
from dicedesign.tolerances import SAME_REST_ANGLE

__all__ = [
    "Clusters",
    "EnergyWeights",
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
        for name in ("coplanar", "barycenter", "neighbor", "stability"):
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

    def relaxed(self, factor: float) -> EnergyWeights:
        """The same with the barycenter and neighbor terms times a factor. Those two pull away from
        the target; the coplanar and stability terms vanish on a finished die and stay."""
        return replace(self, barycenter=self.barycenter * factor, neighbor=self.neighbor * factor)

    def narrowed(self, factor: float) -> EnergyWeights:
        """The same with the stability margin times a factor. A basin holds at least the circle of
        that radius about its rest, so that small probabilities need small margins."""
        return replace(self, stability_margin=self.stability_margin * factor)


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
    """E_cl (eq. 13): squared distances of normals (r, 3), over ordered pairs within a cluster."""
    first, second = np.nonzero(clusters.of_rest[:, None] == clusters.of_rest[None, :])
    return ((rest_normals[first] - rest_normals[second]) ** 2).sum()


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
    hull, depth = rests.hull, rests.facet_depths
    sign = torch.full((len(hull.normals),), -1.0, dtype=torch.float64)
    wanted = outcome_facets(hull.normals, clusters.directions, depth.detach().numpy())
    sign[wanted] = 1.0
    missing = len(clusters.directions) - len(wanted)
    wall = (torch.relu(1.0 - sign * depth / margin) ** 2).sum()
    return wall + missing * (1.0 + 1.0 / margin) ** 2


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
    """The weighted terms of eq. 16 by name; only those with a weight are evaluated."""
    terms = {"dice": dice_energy(rests.probabilities, clusters, target)}
    if weights.coplanar > 0.0:
        terms["coplanar"] = weights.coplanar * coplanar_energy(rests.rest_normals, clusters)
    if weights.barycenter > 0.0:
        terms["barycenter"] = weights.barycenter * barycenter_energy(rests, clusters)
    if weights.neighbor > 0.0:
        near = neighbor_energy(rests, clusters, weights.neighbor_radius)
        terms["neighbor"] = weights.neighbor * near
    if weights.stability > 0.0:
        wall = stability_energy(rests, clusters, weights.stability_margin)
        terms["stability"] = weights.stability * wall
    return terms
