"""Facets near an outcome's direction drawn to it: E_nb (eq. 15)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.optimize.energy.term import TERMS, EnergyWeights, Term, TermOption

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests

__all__ = ["neighbor_energy"]


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


TERMS.register(
    Term(
        name="neighbor",
        line="draws facets near an outcome's direction to it (lambda_nb of eq. 15)",
        rank=3,
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
)
