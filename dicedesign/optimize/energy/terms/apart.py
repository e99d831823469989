"""Outcomes kept apart: an extension of the paper's energy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.optimize.energy.term import TERMS, EnergyWeights, Term, TermOption

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests
    from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["apart_energy", "apart_slopes"]

CLOSEST: Final = 1e-6
"""Squared distance of two directions below which the energy no longer grows, so that it stays
finite."""


def apart_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Keeps the outcomes' mean normals m_i a chord length r = `apart_distance` apart.

    Each pair pays `-(1 - x)^2 ln x`, where `x = |m_i - m_j|^2 / r^2` is below 1. The value and two
    derivatives vanish at x = 1; below a distance of 1e-3 the energy no longer grows. Not in the
    paper, whose energy lets two outcomes grow into one facet.
    """
    import torch

    from dicedesign.optimize.energy.clusters import updated_directions

    clusters, normals = state.clusters, state.rests.rest_normals
    zeros = torch.zeros(clusters.directions.shape, dtype=torch.float64)
    sums = zeros.index_add(0, torch.as_tensor(clusters.of_rest), normals)
    filled = torch.as_tensor(np.unique(clusters.of_rest))
    means = torch.as_tensor(clusters.directions).clone()
    means[filled] = torch.nn.functional.normalize(sums[filled], dim=1)
    first, second, _ = _near(updated_directions(normals.detach().numpy(), clusters), weights)
    squared = ((means[first] - means[second]) ** 2).sum(1).clamp_min(CLOSEST)
    part = squared / weights.apart_distance**2
    return (-((1.0 - part) ** 2) * torch.log(part)).sum()


def apart_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """The apart energy and its derivative (r, 3) in the unit normal of each rest."""
    from dicedesign.optimize.energy.clusters import updated_directions

    clusters = state.clusters
    normals = state.hull.normals[state.rests.paths.rests]
    slopes = np.zeros_like(normals)
    means = updated_directions(normals, clusters)
    first, second, squared = _near(means, weights)
    if len(first) == 0:
        return 0.0, slopes
    range_squared = weights.apart_distance**2
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


def _near(means: Floats, weights: EnergyWeights) -> tuple[Integers, Integers, Floats]:
    """Pairs (p,), (p,) of directions (k, 3) nearer than the distance, and its squares (p,)."""
    first, second = np.triu_indices(len(means), 1)
    offset = means[first] - means[second]
    squared = (offset * offset).sum(1)
    near = squared < weights.apart_distance**2
    return first[near], second[near], squared[near]


TERMS.register(
    Term(
        name="apart",
        line="keeps outcomes from growing into one facet; 0 is the paper's energy",
        rank=5,
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
        of_normals=apart_slopes,
    )
)
