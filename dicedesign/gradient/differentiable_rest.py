"""Rests of one hull, or of many at once, with their odds, as a differentiable function."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.gradient.body_function import double_tensor
from dicedesign.gradient.odds_model import odds_model
from dicedesign.gradient.rested_bodies import rested

if TYPE_CHECKING:
    from dicedesign.rest.prior import Prior


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


def differentiable_rest_batch(
    bodies: Tensor | Sequence[Tensor],
    centers_of_mass: Tensor | None = None,
    *,
    counts: Tensor | Sequence[int] | None = None,
    table: str | None = None,
    prior: Prior | str | None = None,
) -> tuple[Tensor, Tensor]:
    """`differentiable_rest` of many bodies in one call, for all that it says of one.

    Compiled kernels do them all on as many threads as torch has (`torch.set_num_threads`), and let
    other threads of Python run meanwhile.

    Parameters
    ----------
    bodies: points of b bodies: a list of (n_i, 3) tensors of one type on one device, or one (b, n,
        3) tensor.
    centers_of_mass: (b, 3), or None for those of the uniform solid hulls.
    counts: (b,) with a tensor of bodies, how many of its rows each body has; the others are left
        out of account and get zero gradient. None for all.
    table, prior: see `differentiable_rest`.

    Returns
    -------
    normals: (b, k, 3), of each body as `differentiable_rest` has them, for k rests of the body with
        most. A body with fewer has 0 in the rows that are left.
    probabilities: (b, k), 0 in those rows and nowhere else.

    Raises
    ------
    As `differentiable_rest`; what is wrong with a body comes after "body" and its number, from 0.
    """
    if isinstance(bodies, Tensor):
        points = double_tensor(bodies, "bodies", "b", "n", 3)
        like, kept = bodies, None if counts is None else _counts(counts, *points.shape[:2])
    else:
        if counts is not None:
            raise InputError("counts: expected none with a list of bodies; leave them out")
        points, kept = _padded(bodies)
        like = bodies[0] if len(bodies) > 0 else points
    centers = None
    if centers_of_mass is not None:
        centers = double_tensor(centers_of_mass, "centers of mass", len(points), 3)
    if len(points) == 0:
        return points[:, :0].to(like), points[:, :0, 0].to(like)
    normals, probabilities = rested(
        points,
        centers,
        kept,
        single_precision=like.dtype == torch.float32,
        model=odds_model(table, prior),
    )
    return normals.to(like), probabilities.to(like)


def _counts(given: Tensor | Sequence[int], bodies: int, most: int) -> Tensor:
    """How many points each body has (b,), from 0 to the number of rows."""
    counts = torch.as_tensor(given).to("cpu")
    whole = not (counts.is_floating_point() or counts.is_complex())
    if counts.shape != (bodies,) or not (whole or bodies == 0):
        raise InputError(
            f"counts: expected a whole number for each of {bodies} bodies, got {counts.dtype} of "
            f"shape {tuple(counts.shape)}; say how many rows each body has"
        )
    for body in torch.nonzero((counts < 0) | (counts > most)).ravel().tolist()[:1]:
        raise InputError(
            f"counts: expected from 0 to {most} points, got {int(counts[body])} for body {body}; "
            "say how many of its rows each body has"
        )
    return counts.to(torch.int64)


def _padded(bodies: Sequence[Tensor]) -> tuple[Tensor, Tensor | None]:
    """Points (b, n, 3), and how many each body has, or None if all have as many."""
    if len(bodies) == 0:
        return torch.zeros((0, 0, 3), dtype=torch.float64), None
    first = bodies[0]
    for body, given in enumerate(bodies):
        double_tensor(given, f"body {body}", "n", 3)
        if given.dtype != first.dtype or given.device != first.device:
            raise InputError(
                f"body {body}: expected {first.dtype} on {first.device} as body 0, got "
                f"{given.dtype} on {given.device}; convert all to one type on one device"
            )
    sizes = [len(given) for given in bodies]
    most = max(sizes)
    if min(sizes) == most:
        return double_tensor(torch.stack(list(bodies)), "bodies", "b", "n", 3), None
    counts = torch.tensor(sizes)
    places, start = torch.arange(most), counts.cumsum(0) - counts
    # A row too many repeats any point: nobody looks at it, and its gradient is 0.
    rows = torch.where(places < counts[:, None], start[:, None] + places, 0)
    flat = double_tensor(torch.cat(list(bodies)), "bodies", "t", 3)
    return flat.index_select(0, rows.ravel()).reshape(len(sizes), most, 3), counts
