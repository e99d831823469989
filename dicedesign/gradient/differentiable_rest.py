"""Rests of a hull, with their odds, as a differentiable function."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from dicedesign.gradient.odds_model import odds_model
from dicedesign.gradient.rested_bodies import rested
from dicedesign.gradient.tensors import double_tensor

if TYPE_CHECKING:
    from dicedesign.rest.prior import Prior

__all__ = ["differentiable_rest"]


def differentiable_rest(
    vertices: Tensor,
    center_of_mass: Tensor | None = None,
    *,
    table: str | None = None,
    prior: Prior | str | None = None,
) -> tuple[Tensor, Tensor]:
    """Rests of the convex hull of points, differentiable in the points and the center of mass.

    Autograd and the transforms of `torch.func` differentiate it, forward and backward and more than
    once. Where `torch.func.vmap` maps over bodies with different numbers of rests, a body has 0 in
    the rows that are left.

    Parameters
    ----------
    vertices: (n, 3) float32 or float64 tensor, any length unit; points inside the hull get zero
        gradient. All is computed in float64 on the CPU, and handed back as it came. float32 points
        count as rounded ones, see `convex_hull`.
    center_of_mass: (3,) such tensor, strictly inside the hull, or None for that of the uniform
        solid hull, whose own gradient is then included.
    table: name or .json file of a table, for the odds of a body that is thrown onto it, by the
        momentum model; None for a body that is let go without momentum. What is thrown has the
        inertia of the uniform solid hull.
    prior: where not all orientations are equally likely at first, such as "vmf:0,0,-1:5", see
        `RestPoses.under`; second derivatives are NaN then. Not with a table.

    Returns
    -------
    normals: (k, 3) outward unit normals of the stable facets, the most probable first.
    probabilities: (k,) summing to 1.

    Raises
    ------
    InputError: no tensors of these kinds and shapes, an unknown table, a prior that has no density,
        or both a table and a prior.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.

    Of a body that balances within rounding the mean of both sides is returned, as by `rest_poses`.

    Source: algorithm 3, eq. 9 and 10; section 3.1.
    """
    points = double_tensor(vertices, "vertices", "n", 3)
    center = None
    if center_of_mass is not None:
        center = double_tensor(center_of_mass, "center of mass", 3)
    normals, probabilities = rested(
        points,
        center,
        single_precision=vertices.dtype == torch.float32,
        model=odds_model(table, prior),
    )
    return normals.to(vertices), probabilities.to(vertices)
