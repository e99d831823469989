"""Derivatives of probabilities of bodies whose facets have more than three sides, in corners and in
half-spaces, against differences of the 60-digit oracle.

What the derivative is where corners leave a facet's plane says
`tests.reference.oracle_derivatives`. So where the center of mass is given all corners
move at random, and the body of the oracle breaks. Those of a uniform solid are moved by a linear
map, which keeps facets flat. Half-spaces move at random where three facets meet in each corner;
where more do, a motion that splits none is a linear map too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np
import torch

from dicedesign.bench.measures.gradients.gradient_errors import error_limit
from dicedesign.bench.rows import Row, column
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.optimize.starts.kinds.prism import prism
from dicedesign.optimize.starts.repulsion import repulsion
from dicedesign.runtime.arrays import Floats
from tests.reference import solids
from tests.reference.condition import derivative_condition
from tests.reference.oracle_derivatives import (
    as_floats,
    broken_derivative,
    corner_motion,
    derivative,
    half_space_motion,
)
from tests.reference.problem import Problem, turned

__all__ = ["PolygonRow", "polygon_bodies", "polygon_row", "random_polyhedron"]

OFF_CENTER: Final = 0.2
"""How far a given center of mass is from the centroid, over its distance from the nearest facet."""

FACETS: Final = (5, 24)
"""Fewest and most facets of a random polyhedron."""

SEED: Final = 21
"""Of all random polyhedra."""


@dataclass(frozen=True)
class PolygonRow(Row):
    """How right derivatives are. Errors are the largest over the largest derivative.

    Attributes
    ----------
    name: of the body; facets, corners, sides: how many, the most of one facet; rests: how many.
    uniform: whether its center of mass follows from its corners, or stays where it is.
    error: of gradients in the corners, one by one.
    jacobian: of `RestEvaluation.jacobian`.
    broken: of the same from the sum over the triangles into which facets break; None where they
        stay flat, or are flat to single precision only.
    half_spaces: of the Jacobian in `FacetCoordinates` by `Shape.in_parameters`; None where facets
        are flat to single precision only.
    limit: what they may be.
    """

    table: ClassVar[str | None] = None
    computed: ClassVar[tuple[str, ...]] = ("ok",)

    name: str = column("body", -30)
    facets: int = column("facets", 7)
    corners: int = column("corners", 8)
    sides: int = column("sides", 6)
    rests: int = column("rests", 6)
    uniform: bool = column("center", 9, lambda uniform: "uniform" if uniform else "given")
    error: float = column("gradient", 10, ".1e")
    jacobian: float = column("Jacobian", 10, ".1e")
    broken: float | None = column("broken", 10, ".1e")
    half_spaces: float | None = column("half-sp.", 10, ".1e")
    limit: float = column("limit", 10, ".1e")

    @property
    def worst(self) -> float:
        """The largest of the errors."""
        return max(self.error, self.jacobian, self.broken or 0.0, self.half_spaces or 0.0)

    @property
    def ok(self) -> bool:
        """Whether all are within the limit."""
        return self.worst <= self.limit


def polygon_bodies() -> Iterator[tuple[str, Problem]]:
    """Named bodies, each uniform: dice, solids as they are and turned, and dice as their files have
    them, in single precision."""
    named = {
        "cube": solids.platonic("cube"),
        "box 1 x 2 x 3": solids.box(1.0, 2.0, 3.0),
        "octahedron": solids.platonic("octahedron"),
        "dodecahedron": solids.platonic("dodecahedron"),
        **{f"prism {sides}": solids.prism(sides) for sides in (3, 5, 12)},
        "antiprism 5": solids.antiprism(5),
        "truncated octahedron": solids.archimedean("truncated octahedron"),
        "prism with caps": Problem(prism(5).points),
    }
    dice = {
        "2d6 hendecahedron": Problem(hendecahedron("bisymmetric").points),
        **{f"{facets} facets apart": Problem(repulsion(facets, 0).points) for facets in (12, 20)},
    }
    for number, (name, body) in enumerate({**named, **dice}.items()):
        plain = Problem(body.points)
        yield name, plain
        yield f"{name}, turned", turned(plain, number)
    for name, body in dice.items():
        yield f"{name}, as a file", Problem(body.points.astype(np.float32).astype(np.float64))


def random_polyhedron(number: int) -> Problem:
    """The body of a number: random half-spaces whose corners three facets share."""
    rng = np.random.default_rng([SEED, number])
    while True:
        facets = int(rng.integers(FACETS[0], FACETS[1] + 1))
        normals = unit_vectors(rng.normal(size=(facets, 3)))
        distances = np.exp(0.2 * rng.normal(size=facets))
        try:
            hull = convex_hull(polyhedron_corners(normals, distances))
        except (ArithmeticError, ValueError):
            continue
        rests = evaluate_rests(torch.tensor(hull.vertices))
        if np.abs(hull.vertices).max() < 10.0 and len(rests.paths.rests) > 1:
            return Problem(hull.vertices)


def polygon_row(name: str, problem: Problem, *, uniform: bool, seed: int = 0) -> PolygonRow:
    """Compare the derivatives of one body, which has at least two rests; its center of mass is the
    centroid, or fixed near to it."""
    rng = np.random.default_rng([seed, len(problem.points), uniform])
    single = name.endswith("as a file")

    def hull_of(points: Floats) -> ConvexHull:
        return convex_hull(points, single_precision=single)

    hull = hull_of(problem.points)
    clearance = float(hull.heights(hull.centroid).min())
    center = None
    if not uniform:
        center = hull.centroid + OFF_CENTER * clearance * unit_vectors(rng.normal(size=3))
    rests = _evaluated(hull.vertices, center, hull_of)
    hull, still = rests.hull, np.zeros(3)
    stretch = rng.normal(size=(3, 3))
    along = (hull.vertices - hull.centroid) @ stretch.T
    if not uniform:
        along = float(norms(along).max()) * rng.normal(size=along.shape)
    motion = corner_motion(hull, center, along, still)
    exact = as_floats(derivative(motion))
    found = np.array(
        [
            np.vdot(torch.autograd.grad(one, rests.vertices, retain_graph=True)[0].numpy(), along)
            for one in rests.probabilities
        ]
    )
    jacobian = rests.jacobian @ along.ravel()
    broken = half_spaces = None
    if not uniform and not single:
        broken = _error(rests, jacobian, as_floats(broken_derivative(motion)))
    if not single:
        half_spaces = _half_space_error(hull, center, stretch, rng)
    row = PolygonRow(
        name=name,
        facets=len(hull.normals),
        corners=len(hull.vertices),
        sides=int(np.diff(hull.facet_start).max()),
        rests=len(rests.odds),
        uniform=uniform,
        error=_error(rests, found, exact),
        jacobian=_error(rests, jacobian, exact),
        broken=broken,
        half_spaces=half_spaces,
        limit=0.0,
    )
    limit = error_limit(row.worst, lambda: derivative_condition(hull, center, along, still))
    return replace(row, limit=limit)


def _evaluated(
    points: Floats, center: Floats | None, hull_of: Callable[[Floats], ConvexHull]
) -> RestEvaluation:
    given = None if center is None else torch.tensor(center)
    return evaluate_rests(torch.tensor(points, requires_grad=True), given, hull_of)


def _half_space_error(
    hull: ConvexHull, center: Floats | None, stretch: Floats, rng: np.random.Generator
) -> float:
    """Largest error of the derivatives where the half-spaces of a hull move, at random if three
    meet in each corner, else by a linear map (3, 3)."""
    coordinates, parameters = FacetCoordinates.of(hull.vertices, hull.centroid)
    if (np.bincount(hull.tail) == 3).all():
        along = rng.normal(size=parameters.shape)
    else:
        # (n - t A^T n) . x = d: of the unit normal the logarithm of d grows with t n . A^T n.
        normals = parameters[: 3 * len(hull.normals)].reshape(-1, 3)
        turning = normals @ stretch
        along = np.concatenate([-turning.ravel(), (normals * turning).sum(axis=1)])
    shape = coordinates.shape(parameters)
    rests = _evaluated(shape.points, center, convex_hull)
    jacobian = shape.in_parameters(rests.jacobian, rests.hull.source)
    motion = half_space_motion(rests.hull, center, coordinates.origin, parameters, along)
    return _error(rests, jacobian @ along, as_floats(derivative(motion)))


def _error(rests: RestEvaluation, found: Floats, exact: Floats) -> float:
    """Largest difference of derivatives (k,) of the rests from those (m,) of all facets, over the
    largest of these."""
    all_found = np.zeros(len(exact))
    all_found[rests.paths.rests] = found
    return float(np.abs(all_found - exact).max() / np.abs(exact).max())
