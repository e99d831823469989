"""The terms of the energy that come with the package: those of the paper, one that keeps facets
stable or unstable by a margin, and one that keeps outcomes apart."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.optimize.energy.term import (
    LARGEST_SQUARED_DISTANCE,
    SMALLEST_MEAN,
    EnergyWeights,
    Term,
    TermOption,
)

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests
    from dicedesign.runtime.arrays import Floats


def dice_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_dice (eq. 12): squared differences of the clusters' probabilities from the target."""
    import torch

    wanted = torch.as_tensor(state.target, dtype=torch.float64)
    return ((state.outcome_probabilities - wanted) ** 2).sum()


DICE: Final = Term(
    name="dice",
    line="squared differences of the outcomes' odds from the target (eq. 12)",
    evaluate=dice_energy,
    weight=None,
    kernel=0,
)


def coplanar_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_cl (eq. 13): squared distances of rest normals, over ordered pairs within a cluster, which
    are 2 n times those from the mean of its n normals."""
    import torch

    clusters, normals = state.clusters, state.rests.rest_normals
    of_rest = torch.as_tensor(clusters.of_rest)
    counts = torch.bincount(of_rest, minlength=len(clusters.directions)).clamp_min(1)[:, None]
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    means = zeros.index_add(0, of_rest, normals) / counts
    return (2.0 * counts[of_rest] * (normals - means[of_rest]) ** 2).sum()


COPLANAR: Final = Term(
    name="coplanar",
    line="draws the rests of an outcome into one plane (lambda_cl of eq. 13)",
    evaluate=coplanar_energy,
    weight=0.1,
    kernel=1,
)


def barycenter_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_bc (eq. 14): squared distances of rest normals from the barycenter of their cluster's
    region, which is the normalised mean of the maxima on the region's border."""
    import torch

    rests, clusters, paths = state.rests, state.clusters, state.rests.paths
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


BARYCENTER: Final = Term(
    name="barycenter",
    line="draws the rests of an outcome to the middle of its region (lambda_bc of eq. 14)",
    evaluate=barycenter_energy,
    weight=2.0,
    kernel=2,
)


def neighbor_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_nb (eq. 15): squared distances from u_i of all facet normals within a radius of it; stable
    facets or not. An outcome without a facet nearby is charged the squared radius."""
    import torch

    directions, radius = state.clusters.directions, weights.neighbor_radius
    squared = ((directions[:, None, :] - state.hull.normals[None, :, :]) ** 2).sum(-1)
    outcome, facet = np.nonzero(squared < radius**2)
    alone = len(directions) - len(np.unique(outcome))
    offset = state.rests.facet_normals(facet) - torch.as_tensor(directions[outcome])
    return (offset**2).sum() + alone * radius**2


NEIGHBOR: Final = Term(
    name="neighbor",
    line="draws facets near an outcome's direction to it (lambda_nb of eq. 15)",
    evaluate=neighbor_energy,
    weight=0.1,
    options=(
        TermOption(
            name="neighbor_radius",
            default=0.2,
            line="chord length epsilon of the ball about an outcome's direction in eq. 15, "
            "above 0 and at most 2",
            expected="a chord length above 0 and at most 2",
            remedy="leave it out for 0.2",
            allows=lambda radius: 0.0 < radius <= 2.0,
        ),
    ),
    kernel=3,
)


def stability_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """As `stability_slopes`."""
    import torch

    value, slopes = stability_slopes(state, weights)
    depths = state.rests.facet_depths
    return value + (torch.as_tensor(slopes) * (depths - depths.detach())).sum()


def stability_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Keeps one facet for each outcome stable and all others unstable, by a margin: the energy and
    its derivative (m,) in each facet's depth.

    A facet of depth s (`RestEvaluation.facet_depths`) with an outcome pays
    `max(0, 1 - s / margin)^2`, another one the same with -s; an outcome without a facet is charged
    the most. Probabilities jump where a depth crosses zero; this wall in front of the jump is what
    lets a smooth method walk along it. Not in the paper.
    """
    from dicedesign.optimize.energy.clusters import outcome_facets

    normals, directions = state.hull.normals, state.clusters.directions
    depths, margin = state.rests.depths, weights.stability_margin
    wanted = outcome_facets(normals, directions, depths)
    signs = np.full(len(normals), -1.0)
    signs[wanted] = 1.0
    lacking = np.maximum(1.0 - signs * depths / margin, 0.0)
    least = (len(directions) - len(wanted)) * (1.0 + 1.0 / margin) ** 2
    return float(lacking @ lacking) + least, -2.0 / margin * signs * lacking


STABILITY: Final = Term(
    name="stability",
    line="keeps one facet for each outcome stable and all others unstable; 0 is the paper's energy",
    evaluate=stability_energy,
    weight=0.1,
    options=(
        TermOption(
            name="stability_margin",
            default=0.05,
            line="distance of a facet from the edge of (in)stability, over the circumscribed "
            "radius, below which the term acts; above 0 and at most 1",
            expected="a fraction above 0 and at most 1",
            remedy="leave it out for 0.05",
            allows=lambda margin: 0.0 < margin <= 1.0,
        ),
    ),
    single_rests=True,
    value_and_slopes=stability_slopes,
    slopes_in="depths",
)


CLOSEST: Final = 1e-6
"""Squared distance of two directions below which the energy no longer grows, so that it stays
finite."""


def apart_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """As `apart_slopes`."""
    import torch

    value, slopes = apart_slopes(state, weights)
    normals = state.rests.rest_normals
    return value + (torch.as_tensor(slopes) * (normals - normals.detach())).sum()


def apart_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """Keeps the outcomes' mean normals m_i a chord length r = `apart_distance` apart: energy and
    its derivative (r, 3) in the unit normal of each rest.

    Each pair pays `-(1 - x)^2 ln x`, where `x = |m_i - m_j|^2 / r^2` is below 1. The value and two
    derivatives vanish at x = 1; below a distance of 1e-3 the energy no longer grows. Not in the
    paper, whose energy lets two outcomes grow into one facet.
    """
    from dicedesign.optimize.energy.clusters import updated_directions

    clusters = state.clusters
    normals = state.hull.normals[state.rests.paths.rests]
    slopes = np.zeros_like(normals)
    means = updated_directions(normals, clusters)
    range_squared = weights.apart_distance**2
    first, second = np.triu_indices(len(means), 1)
    offset = means[first] - means[second]
    squared = (offset * offset).sum(1)
    near = squared < range_squared
    if not near.any():
        return 0.0, slopes
    first, second, squared = first[near], second[near], squared[near]
    part = np.maximum(squared, CLOSEST) / range_squared
    value = float((-((1.0 - part) ** 2) * np.log(part)).sum())
    steepness = 2.0 * (1.0 - part) * np.log(part) - (1.0 - part) ** 2 / part
    steepness = np.where(squared > CLOSEST, steepness, 0.0) / range_squared
    pull = (2.0 * steepness)[:, None] * (means[first] - means[second])
    by_mean = np.zeros_like(means)
    np.add.at(by_mean, first, pull)
    np.add.at(by_mean, second, -pull)
    # Through the normalisation of the sum of each cluster's normals.
    sums = np.zeros_like(means)
    np.add.at(sums, clusters.of_rest, normals)
    lengths = np.sqrt((sums * sums).sum(1))
    across = by_mean - means * (by_mean * means).sum(1)[:, None]
    slopes += (across / np.where(lengths > 0.0, lengths, 1.0)[:, None])[clusters.of_rest]
    return value, slopes


APART: Final = Term(
    name="apart",
    line="keeps outcomes from growing into one facet; 0 is the paper's energy",
    evaluate=apart_energy,
    weight=0.0,
    options=(
        TermOption(
            name="apart_distance",
            default=0.4,
            line="chord length between the mean normals of two outcomes below which the term "
            "acts, from 0.01 to 2; 0.4 is 23 degrees",
            expected="a chord length from 0.01 to 2",
            remedy="leave it out for 0.4",
            allows=lambda distance: 0.01 <= distance <= 2.0,
        ),
    ),
    value_and_slopes=apart_slopes,
    slopes_in="normals",
)
