"""Lower a custom energy of the facets of a die with `torch.optim.LBFGS`.

The energy favors the target probabilities, and rests that are hard to tip over.

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
    """Return the squared errors plus a penalty on rests close to saddles, and the state.

    The penalty is a mean power of the cosines between rests and adjacent saddles.
    """
    rests = dd.evaluate_rests(points)
    state = ClusteredRests.of(rests, START.directions, TARGET.numpy())
    neighbors = rests.rest_normals[torch.as_tensor(rests.paths.basins)]
    cosines = (neighbors * rests.saddles[:, None]).sum(-1)
    errors = state.outcome_probabilities - TARGET
    return (errors**2).sum() + firmness * (cosines**8).mean(), state


def design(firmness: float) -> None:
    """Run thirty iterations with line searches, and print the result."""
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
    neighbors = rests.rest_normals[torch.as_tensor(rests.paths.basins)]
    angle = torch.rad2deg(torch.arccos((neighbors * rests.saddles[:, None]).sum(-1).max()))
    error = (state.outcome_probabilities - TARGET).abs().max()
    print(
        f"firmness {firmness:g}: {len(rests.facets)} rests on facets {rests.facets.tolist()} of "
        f"{len(rests.hull.normals)}, {len(rests.saddles)} saddles, largest |p - q| {error:.1e}, "
        f"least angle from a rest to a saddle {angle:.1f} degrees"
    )


if __name__ == "__main__":
    design(0.0)
    design(0.01)
