"""Add an energy term, and lower it with the built-in method or a torch optimizer.

A term receives the current state: the hull, its rests and probabilities, the clusters of rests of
each outcome, the saddles and maxima between them, and vertices with gradients.
"""

from __future__ import annotations

import numpy as np
import torch

import dicedesign as dd
from dicedesign.energies import ClusteredRests, EnergyWeights, energy_terms
from dicedesign.extensions import TERMS, Term
from dicedesign.methods import PaperOptions, PaperWeights, solve_paper
from dicedesign.starts import prism


def firm_rests(state: ClusteredRests, weights: EnergyWeights) -> torch.Tensor:
    """Penalize rests close to saddles: powers of the cosines between a rest and its saddles."""
    basins = torch.as_tensor(state.rests.paths.basins)
    cosines = (state.rests.rest_normals[basins] * state.saddles[:, None]).sum(-1)
    # Saddles between two rests of one outcome do not change the outcome.
    outcome = state.clusters.of_rest[state.rests.paths.basins]
    leads_out = torch.as_tensor(outcome[:, 0] != outcome[:, 1])
    return (cosines[leads_out] ** 8).sum()


TERMS.register(Term(name="firm_rests", line="rests that are hard to tip over", evaluate=firm_rests))

TARGET = dd.custom([0.5, 0.3, 0.2]).probabilities
START = prism(3)


def run_paper(weight: float) -> None:
    """Run the paper's method; in a recipe: method: {paper: {weights: {firm_rests: 0.3}}}.

    `finish="none"`, as the exact finish drops the energy terms.
    """
    weights = PaperWeights(firm_rests=weight)
    die = solve_paper(START, TARGET, PaperOptions(weights=weights, finish="none"))
    print(
        f"the paper's method, weight {weight:g}: largest |p - q| {die.error:.2g}, "
        f"least angle from a rest to a saddle {least_angle(die.hull.vertices):.1f} degrees"
    )


def run_adam(weight: float) -> None:
    """Run any optimizer: autograd differentiates the energy with respect to the vertices.

    `EnergyWeights` are in the unit of eq. 12. A weight of a recipe or of `PaperWeights` is
    (4 pi)^2, about 158, times as large: 0.3 there is 0.002 here.
    """
    vertices = torch.tensor(START.points, requires_grad=True)
    weights = EnergyWeights(firm_rests=weight, barycenter=0.0, neighbor=0.0)
    adam = torch.optim.Adam([vertices], lr=8e-3)
    for _ in range(100):
        rests = dd.evaluate_rests(vertices)
        terms = energy_terms(ClusteredRests.of(rests, START.directions, TARGET), weights)
        adam.zero_grad()
        torch.stack(list(terms.values())).sum().backward()
        adam.step()
    print(
        f"torch.optim.Adam, weight {weight:g}: sum of (p - q)^2 {terms['dice'].item():.2g}, "
        f"least angle {least_angle(vertices.detach().numpy()):.1f} degrees"
    )


def least_angle(points: np.ndarray) -> float:
    """Least angle in degrees between a rest and a saddle on the border of its basin."""
    rests = dd.evaluate_rests(torch.tensor(points))
    normals = rests.rest_normals[torch.as_tensor(rests.paths.basins)]
    cosines = (normals * rests.saddles[:, None]).sum(-1)
    return float(torch.rad2deg(torch.arccos(cosines.max())))


if __name__ == "__main__":
    run_paper(0.0)
    run_paper(0.3)
    run_adam(0.002)
