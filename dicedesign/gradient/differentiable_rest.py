"""Rests and probabilities of one hull, or of many at once, as a differentiable function.

Compiled kernels compute all bodies in one call, on as many threads as torch has. Bodies that
rounding could change, other models of probabilities, and higher derivatives are computed body by
body (`RestEvaluation`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, hull_precision
from dicedesign.gradient.body_function import (
    BodyFunction,
    double_tensor,
    take_constant,
    uncompiled,
)
from dicedesign.gradient.probability_model import RESTING, ProbabilityModel, probability_model
from dicedesign.gradient.rest_probabilities import RestEvaluation, facet_normals, hull_centroid
from dicedesign.kernels import ops as kernels
from dicedesign.rest.basins import Basins, merged_rests, rest_basins
from dicedesign.rest.equilibria import classify
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.rest.prior import Prior


def _find_rests(
    points: Tensor,
    centers: Tensor | None,
    counts: Integers | None,
    like: Tensor,
    model: ProbabilityModel,
) -> tuple[Tensor, Tensor]:
    """Normals (*l, k, 3) and probabilities (*l, k) of the rests of bodies (*l), the most probable
    first. A body with fewer than k rests has zeros in the other rows.

    points: (*l, n, 3) float64; centers: (*l, 3) centers of mass, or None for uniform solids;
    counts: (b,) number of points of each body, the others are ignored; None for all. like: tensor
    with the type and device of the result.
    """
    bodies = _RestedBodies(counts, like.dtype == torch.float32, model)
    inputs = (points,) if centers is None else (points, centers)
    which = take_constant(bodies.find, *inputs)
    normals, probabilities = bodies.function(which, *inputs)
    return normals.to(like), probabilities.to(like)


class _RestedBodies:
    """Bodies of one call: their combinatorics, and the function from points to rests."""

    def __init__(
        self, counts: Integers | None, single_precision: bool, model: ProbabilityModel
    ) -> None:
        self._given_counts, self._model = counts, model
        self._single_precision = single_precision
        # Hull of a body, and its basins or those of the bodies beside it if it is tied.
        self._sides: dict[int, tuple[ConvexHull, tuple[Basins, ...]]] = {}
        self._records: dict[int, tuple[tuple[Tensor, ...], Integers, Tensor, Tensor]] = {}

    @property
    def function(self) -> BodyFunction:
        """Function from points, and given centers, to normals and probabilities."""
        return BodyFunction(
            1 if self._centers is None else 2,
            2,
            self._formula,
            lambda which, *_: (self._normals[which], self._probabilities[which]),
            self._adjoint,
        )

    def find(self, points: Floats, *centers: Floats) -> Integers:
        """Find the rests of bodies (*l), and number the bodies. centers: see `_find_rests`."""
        lead, (size, _) = points.shape[:-2], points.shape[-2:]
        bodies = math.prod(lead)
        self._points = np.ascontiguousarray(points).reshape(bodies, size, 3)
        self._centers = np.ascontiguousarray(centers[0]).reshape(bodies, 3) if centers else None
        if self._given_counts is None:
            self._counts: Integers = np.full(bodies, size)
        else:
            self._counts = np.broadcast_to(self._given_counts, lead).ravel().astype(np.int64)
        self._handle = None
        if self._model == RESTING:
            self._handle = kernels.bodies(
                self._points.reshape(-1, 3),
                size * np.arange(bodies),
                self._counts,
                self._centers,
                *hull_precision(self._single_precision),
                torch.get_num_threads(),
            )
        if self._handle is kernels.UNDECIDED:
            rest_counts = np.zeros(bodies, dtype=np.int64)
            self._facets = np.zeros((bodies, 0), dtype=np.int64)
            self._normals, self._probabilities = np.zeros((bodies, 0, 3)), np.zeros((bodies, 0))
        else:
            rest_counts, self._facets, self._normals, self._probabilities = self._handle.rests()
        for body in np.flatnonzero(rest_counts == 0).tolist():
            try:
                _, facets, normals, probabilities = self._record(body)
            except InputError as error:
                if not lead:
                    raise
                raise type(error)(f"body {body}: {error}") from error
            room = max(len(probabilities) - self._probabilities.shape[1], 0)
            self._facets = np.pad(self._facets, ((0, 0), (0, room)))
            self._probabilities = np.pad(self._probabilities, ((0, 0), (0, room)))
            self._normals = np.pad(self._normals, ((0, 0), (0, room), (0, 0)))
            self._facets[body, : len(probabilities)] = facets
            self._normals[body, : len(probabilities)] = normals.detach().numpy()
            self._probabilities[body, : len(probabilities)] = probabilities.detach().numpy()
        return np.arange(bodies).reshape(lead)

    def _record(self, body: int) -> tuple[tuple[Tensor, ...], Integers, Tensor, Tensor]:
        """Inputs of a body, which are its points (n, 3) and its center of mass (3,) if given; and
        facets (k,), normals (k, 3) and probabilities (k,) of its rests, with gradients."""
        if body not in self._records:
            points, center = self._numbers(body)
            with torch.enable_grad():
                inputs = tuple(torch.tensor(part, requires_grad=True) for part in (points, *center))
                self._records[body] = (inputs, *self._rests(body, *inputs))
        return self._records[body]

    def _numbers(self, body: int) -> tuple[Floats, tuple[Floats, ...]]:
        """Points (n, 3) of a body, and its center of mass (3,) if given."""
        points = self._points[body, : self._counts[body]]
        return points, () if self._centers is None else (self._centers[body],)

    def _rests(
        self, body: int, points: Tensor, given: Tensor | None = None
    ) -> tuple[Integers, Tensor, Tensor]:
        """Facets (k,), normals (k, 3) and probabilities (k,) of the rests of a body, by operations
        of torch."""
        if body not in self._sides:
            numbers, center_of_mass = self._numbers(body)
            hull = convex_hull(numbers, single_precision=self._single_precision)
            middle = center_of_mass[0] if center_of_mass else hull.centroid
            checked = classify(hull, middle).center_of_mass
            self._sides[body] = rest_basins(hull, checked)
        hull, sides = self._sides[body]
        classified = sides[0].equilibria.hull
        corners = points[torch.from_numpy(classified.source)]
        center = hull.centroid if self._centers is None else self._centers[body]
        of_facet = torch.zeros(len(hull.normals), dtype=torch.float64)
        for side in sides:
            aside = side.equilibria.center_of_mass - center
            at = given
            if aside.any():
                own = hull_centroid(corners, classified) if given is None else given
                at = own + torch.from_numpy(aside)
            beside = RestEvaluation(side.equilibria, corners, at, side)
            rests = torch.from_numpy(merged_rests(hull, side))
            of_facet = of_facet.index_add(0, rests, self._model.tensor(beside))
        facets = self._facets[body, : np.count_nonzero(self._normals[body].any(axis=1))]
        if len(facets) == 0:
            resting = np.unique(np.concatenate([merged_rests(hull, side) for side in sides]))
            # Stable, so that equal rests keep the order of their facets.
            order = np.argsort(-of_facet.detach().numpy()[resting], kind="stable")
            facets = resting[order]
        probabilities = of_facet[torch.from_numpy(facets)] / len(sides)
        if hull is not classified:
            normals = facet_normals(hull, facets, points[torch.from_numpy(hull.source)])
            return facets, normals, probabilities
        return facets, beside.facet_normals(facets), probabilities

    def _formula(
        self, body: int, points: Tensor, center: Tensor | None = None
    ) -> tuple[Tensor, Tensor]:
        _, normals, probabilities = self._rests(body, points, center)
        missing = self._probabilities.shape[1] - len(probabilities)
        pad = torch.nn.functional.pad
        return pad(normals, (0, 0, 0, missing)), pad(probabilities, (0, missing))

    def _adjoint(self, which: Integers, *given: Floats) -> tuple[Floats, ...]:
        *inputs, by_normals, by_probabilities = given
        if self._handle is kernels.UNDECIDED:
            by_inputs = [np.zeros_like(column) for column in inputs]
            known = np.zeros(len(which), np.int64)
        else:
            size, threads = self._points.shape[1], torch.get_num_threads()
            *by_inputs, known = self._handle.pull_back(
                which, by_normals, by_probabilities, size, threads
            )
            by_inputs = by_inputs[: len(inputs)]
        for row in np.flatnonzero(known == 0):
            leaves, _, normals, probabilities = self._record(int(which[row]))
            slopes = [
                torch.from_numpy(column[row, : len(probabilities)])
                for column in (by_normals, by_probabilities)
            ]
            parts = torch.autograd.grad(
                (normals, probabilities),
                leaves,
                slopes,
                retain_graph=True,
                allow_unused=True,
                materialize_grads=True,
            )
            for column, part in zip(by_inputs, parts, strict=True):
                column[row, : len(part)] = part.numpy()
        return tuple(by_inputs)


@uncompiled
def differentiable_rest(
    vertices: Tensor,
    center_of_mass: Tensor | None = None,
    *,
    table: str | None = None,
    prior: Prior | str | None = None,
) -> tuple[Tensor, Tensor]:
    """Rests of the convex hull of points, differentiable in the points and the center of mass.

    Autograd and the transforms of `torch.func` differentiate it, forward and backward and more than
    once. Under `torch.func.vmap`, zeros pad bodies with fewer rests than the others. The most
    probable rest is first, so a row may change its facet during a descent: match rests by normal.

    Parameters
    ----------
    vertices: (n, 3) float32 or float64 tensor, any length unit; points inside the hull have zero
        gradient. All is computed in float64 on the CPU; results have the dtype and device of the
        vertices. float32 points count as rounded, see `convex_hull`.
    center_of_mass: (3,) tensor, strictly inside the hull, or None for that of the uniform solid
        hull, which moves with the vertices.
    table: name or .json file of a table, for the probabilities of a body that is thrown onto it, by
        the momentum model; None for a body that is let go without momentum. Thrown bodies have the
        inertia of the uniform solid hull.
    prior: distribution of the start orientations, such as "vmf:0,0,-1:5", see `RestPoses.under`;
        second derivatives are NaN then. None is uniform. Not with a table.

    Returns
    -------
    normals: (k, 3) outward unit normals of the stable facets, the most probable first.
    probabilities: (k,) summing to 1.

    Raises
    ------
    InputError: an input is no such tensor, a table is unknown, a prior has no density, or there are
        both a table and a prior.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.

    If a body balances within rounding, the mean of both sides is returned, as by `rest_poses`.

    Source: algorithm 3, eq. 9 and 10; section 3.1.
    """
    points = double_tensor(vertices, "vertices", "n", 3)
    center = None
    if center_of_mass is not None:
        center = double_tensor(center_of_mass, "center of mass", 3)
    return _find_rests(points, center, None, vertices, probability_model(table, prior))


@uncompiled
def differentiable_rest_batch(
    bodies: Tensor | Sequence[Tensor],
    centers_of_mass: Tensor | None = None,
    *,
    counts: Tensor | Sequence[int] | None = None,
    table: str | None = None,
    prior: Prior | str | None = None,
) -> tuple[Tensor, Tensor]:
    """Rests of many bodies in one call; see `differentiable_rest`.

    Compiled kernels use as many threads as torch has (`torch.set_num_threads`), and let other
    threads of Python run meanwhile.

    Parameters
    ----------
    bodies: points of b bodies: a list of (n_i, 3) tensors of one type on one device, or one (b, n,
        3) tensor.
    centers_of_mass: (b, 3), or None for those of the uniform solid hulls.
    counts: (b,) number of rows of each body, for a tensor of bodies; the other rows are ignored
        and have zero gradient. None for all.
    table, prior: see `differentiable_rest`.

    Returns
    -------
    normals: (b, k, 3), most probable first, for the k rests of the body with most. Zeros pad
        bodies with fewer rests.
    probabilities: (b, k), 0 in those rows and nowhere else.

    Raises
    ------
    As `differentiable_rest`; an error about one body begins with "body" and its number, from 0.
    """
    if isinstance(bodies, Tensor):
        points = double_tensor(bodies, "bodies", "b", "n", 3)
        like, point_counts = bodies, None if counts is None else _counts(counts, *points.shape[:2])
    else:
        if counts is not None:
            raise InputError("counts: expected none with a list of bodies; leave them out")
        points, point_counts = _pad(bodies)
        like = bodies[0] if len(bodies) > 0 else points
    centers = None
    if centers_of_mass is not None:
        centers = double_tensor(centers_of_mass, "centers of mass", len(points), 3)
    if len(points) == 0:
        return points[:, :0].to(like), points[:, :0, 0].to(like)
    return _find_rests(points, centers, point_counts, like, probability_model(table, prior))


def _counts(given: Tensor | Sequence[int], bodies: int, most: int) -> Integers:
    """Check numbers of points of bodies (b,), from 0 to the number of rows."""
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
    return counts.to(torch.int64).numpy()


def _pad(bodies: Sequence[Tensor]) -> tuple[Tensor, Integers | None]:
    """Stack bodies of different sizes: points (b, n, 3), and the number of points of each body, or
    None if these are equal."""
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
    # Padding repeats any point; it is ignored, and its gradient is 0.
    rows = torch.where(places < counts[:, None], start[:, None] + places, 0)
    flat = double_tensor(torch.cat(list(bodies)), "bodies", "t", 3)
    return flat.index_select(0, rows.ravel()).reshape(len(sizes), most, 3), counts.numpy()
