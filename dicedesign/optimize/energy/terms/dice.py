"""Odds against target: E_dice (eq. 12)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dicedesign.optimize.energy.term import TERMS, EnergyWeights, Term

if TYPE_CHECKING:
    from torch import Tensor

    from dicedesign.optimize.energy.clusters import ClusteredRests

__all__ = ["dice_energy"]


def dice_energy(state: ClusteredRests, weights: EnergyWeights) -> Tensor:
    """E_dice (eq. 12): squared differences of the clusters' probabilities from the target."""
    import torch

    wanted = torch.as_tensor(state.target, dtype=torch.float64)
    return ((state.outcome_probabilities - wanted) ** 2).sum()


TERMS.register(
    Term(
        name="dice",
        line="squared differences of the outcomes' odds from the target (eq. 12)",
        rank=0,
        evaluate=dice_energy,
        weight=None,
        kernel=0,
    )
)
