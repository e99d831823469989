"""One stable facet for each outcome and no other, by a margin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.optimize.energy.term import TERMS, EnergyWeights, Term, TermOption

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests
    from dicedesign.runtime.arrays import Floats

__all__ = ["stability_energy", "stability_slopes"]


def stability_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """Keeps one facet for each outcome stable and all others unstable, by a margin.

    A facet of depth s (`RestEvaluation.facet_depths`) with an outcome pays
    `max(0, 1 - s / margin)^2`, another one the same with -s. Probabilities jump where a depth
    crosses zero; this wall in front of the jump is what lets a smooth method walk along it. Not in
    the paper.
    """
    import torch

    depths, margin = state.rests.facet_depths, weights.stability_margin
    signs, least = _sides(state, depths.detach().numpy(), margin)
    return (torch.relu(1.0 - torch.as_tensor(signs) * depths / margin) ** 2).sum() + least


def stability_slopes(state: ClusteredRests, weights: EnergyWeights) -> tuple[float, Floats]:
    """The stability energy and its derivative (m,) in each facet's depth."""
    depths, margin = state.rests.depths, weights.stability_margin
    signs, least = _sides(state, depths, margin)
    lacking = np.maximum(1.0 - signs * depths / margin, 0.0)
    return float(lacking @ lacking) + least, -2.0 / margin * signs * lacking


def _sides(state: ClusteredRests, depths: Floats, margin: float) -> tuple[Floats, float]:
    """1 for each facet (m,) with an outcome, -1 for others, and the charge for outcomes that have
    none."""
    from dicedesign.optimize.energy.clusters import outcome_facets

    normals, directions = state.hull.normals, state.clusters.directions
    signs = np.full(len(normals), -1.0)
    wanted = outcome_facets(normals, directions, depths)
    signs[wanted] = 1.0
    return signs, (len(directions) - len(wanted)) * (1.0 + 1.0 / margin) ** 2


TERMS.register(
    Term(
        name="stability",
        line="keeps one facet for each outcome stable and all others unstable; 0 is the paper's "
        "energy",
        rank=4,
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
        of_depths=stability_slopes,
    )
)
