"""Rests of a hull, with their odds, as a differentiable function."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.rest.basins import find_basins

__all__ = ["differentiable_rest"]


def differentiable_rest(
    vertices: Tensor, center_of_mass: Tensor | None = None, *, table: str | None = None
) -> tuple[Tensor, Tensor]:
    """Rests of the convex hull of points, differentiable in the points and the center of mass.

    Parameters
    ----------
    vertices: (n, 3) float64 tensor, any length unit; points inside the hull get zero gradient.
    center_of_mass: (3,) float64 tensor strictly inside the hull, or None for that of the uniform
        solid hull, whose own gradient is then included.
    table: name or .json file of a table, for the odds of a body that is thrown onto it, by the
        momentum model; None for a body that is let go without momentum. What is thrown has the
        inertia of the uniform solid hull.

    Returns
    -------
    normals: (k, 3) outward unit normals of the stable facets, the most probable first.
    probabilities: (k,) summing to 1.

    Raises
    ------
    InputError, DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`, and InputError
    for an unknown table.

    Of a body that balances within rounding the mean of both sides is returned, as by `rest_poses`.

    Source: algorithm 3, eq. 9 and 10; section 3.1.
    """
    thrown = None if table is None else ThrownOdds.on(table)
    rests = evaluate_rests(vertices, center_of_mass)
    center = rests.equilibria.center_of_mass
    sides = find_basins(rests.hull, center)
    hull = sides[0].equilibria.hull
    corners = vertices[torch.as_tensor(hull.source)]
    of_facet = torch.zeros(len(hull.normals), dtype=torch.float64)
    for side in sides:
        aside = side.equilibria.center_of_mass - center
        moved = rests.center + torch.as_tensor(aside) if aside.any() else rests.given_center
        beside = RestEvaluation(side.equilibria, corners, moved, side)
        odds = beside.probabilities if thrown is None else thrown.tensor(beside)
        of_facet = of_facet.index_add(0, torch.as_tensor(side.paths.rests), odds)
    # Stable, so that equal rests keep the order of their facets.
    order = np.argsort(-of_facet.detach().numpy(), kind="stable")
    facets = order[: len(np.unique(np.concatenate([side.paths.rests for side in sides])))]
    return beside.facet_normals(facets), of_facet[torch.as_tensor(facets)] / len(sides)
