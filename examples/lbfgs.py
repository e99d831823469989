"""An energy of one's own, lowered by `torch.optim.LBFGS` in the facets of a die: the probabilities
that are asked for, and rests that take a long way to leave.

    python examples/lbfgs.py
"""

from __future__ import annotations

import numpy as np
import torch

import dicedesign as dd
from dicedesign.energies import ClusteredRests
from dicedesign.methods import FacetCoordinates
from dicedesign.starts import repulsion

TARGET = torch.tensor([0.3, 0.25, 0.2, 0.15, 0.1], dtype=torch.float64)
START = repulsion(5, seed=1)


def energy(points: torch.Tensor, firmness: float) -> tuple[torch.Tensor, ClusteredRests]:
    """Squared differences from the target, and cosines of the angles from rests to the saddles
    beside them."""
    rests = dd.evaluate_rests(points)
    state = ClusteredRests.of(rests, START.directions, TARGET.numpy())
    beside = rests.rest_normals[torch.as_tensor(rests.paths.basins)]
    cosines = (beside * rests.saddles[:, None]).sum(-1)
    misses = state.outcome_probabilities - TARGET
    return (misses**2).sum() + firmness * (cosines**8).mean(), state


def designed(firmness: float) -> None:
    """Thirty iterations, each with a line search."""
    coordinates, numbers = FacetCoordinates.of(START.points, np.zeros(3))
    parameters = torch.tensor(numbers, requires_grad=True)
    optimizer = torch.optim.LBFGS([parameters], max_iter=30, line_search_fn="strong_wolfe")

    def closure() -> torch.Tensor:
        optimizer.zero_grad()
        value, _ = energy(coordinates.points(parameters), firmness)
        value.backward()
        return value

    optimizer.step(closure)
    _, state = energy(coordinates.points(parameters.detach()), firmness)
    rests = state.rests
    beside = rests.rest_normals[torch.as_tensor(rests.paths.basins)]
    angle = torch.rad2deg(torch.arccos((beside * rests.saddles[:, None]).sum(-1).max()))
    miss = (state.outcome_probabilities - TARGET).abs().max()
    print(
        f"firmness {firmness:g}: {len(rests.facets)} rests on facets {rests.facets.tolist()} of "
        f"{len(rests.hull.normals)}, {len(rests.saddles)} saddles, largest |p - q| {miss:.1e}, "
        f"least angle from a rest to a saddle {angle:.1f} degrees"
    )


if __name__ == "__main__":
    designed(0.0)
    designed(0.01)
