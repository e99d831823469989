"""derivatives of probabilities, compared with 60-digit differences

Compare derivatives of probabilities with differences of a 60-digit model: on random hulls of
triangles, on bodies with facets of many sides and their half-spaces, on bodies with paths that
glance or graze; and time them. Exits 1 where an error is beyond its limit.

What the derivative is where corners leave a facet: see `tests.reference.oracle_derivatives`.
So where the center of mass is given all corners move at random, and the body of the oracle breaks.
Facets of more than three sides of a uniform solid are moved by a linear map, which keeps them flat.
Half-spaces move at random where three facets meet in each corner, else by a linear map too.

A path in the cell of p enters at u and crosses the arc of an edge vector v. With unit vectors,
rho = r_p . v and alpha = -u . v, its direction changes by at most |d(rho, alpha)| over
sqrt(rho^2 + alpha^2). So rho -> 0 alone is harmless (glancing): the gradient grows like 1 / rho
only where alpha vanishes too (grazing), where the path enters beside the end of the arc.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import torch

from benchmarks.frame import Report, time_in_turn
from dicedesign import RestEvaluation, evaluate_rests
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull, polyhedron_corners
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.methods import FacetCoordinates
from dicedesign.runtime.arrays import Floats
from dicedesign.starts import hendecahedron, prism, repulsion
from tests.reference import solids
from tests.reference.extremes import large
from tests.reference.oracle_derivatives import (
    corner_motion,
    derivative,
    derivative_condition,
    half_space_motion,
)
from tests.reference.problem import Problem, rotate_problem
from tests.reference.random_hulls import random_hull
from tests.reference.stiff import glancing, grazing_body

ERROR_FLOOR, CONDITION_FACTOR = 1e-13, 10.0
"""An error may be the first on any body, else so many times the derivative's own condition times
machine epsilon."""

OFF_CENTER = 0.2
"""How far a given center of mass is from the centroid, over its distance from the nearest facet."""


@dataclass(frozen=True)
class Comparison:
    """Errors of derivatives over the largest one.

    Attributes
    ----------
    sides: most of a facet.
    errors: "gradient" of gradients one by one; "Jacobian" of `RestEvaluation.jacobian`; where they
        apply "broken" of the same from the sum over the triangles into which facets break, and
        "half-spaces" of the Jacobian in `FacetCoordinates`.
    size: largest norm of a probability's gradient, times the body's radius.
    limit: of the errors.
    """

    sides: int
    errors: dict[str, float]
    size: float
    limit: float

    @property
    def is_right(self) -> bool:
        """Whether all errors are within the limit."""
        return max(self.errors.values()) <= self.limit


def run(options: argparse.Namespace, report: Report) -> bool:
    """All parts."""
    quick = options.quick
    are_good = [
        compare_many("random hulls", random_hulls(100 if quick else 1000), report),
        compare_many("polygons", polygons(12 if quick else None, 20 if quick else 200), report),
        compare_growths(6 if quick else 14, report),
    ]
    time_derivatives(0.1 if quick else 1.0, report)
    return all(are_good)


def compare(
    problem: Problem, *, seed: int, is_file: bool = False, with_center: bool = False
) -> Comparison:
    """Compare the derivatives of a body with at least two rests in one direction.

    is_file: whether its facets are flat to single precision only. with_center: whether a given
    center of mass moves too.
    """
    rng = np.random.default_rng([seed, len(problem.points), problem.center is None])

    def hull_of(points: Floats) -> ConvexHull:
        return convex_hull(points, single_precision=is_file)

    center = None if problem.center is None else torch.tensor(problem.center, requires_grad=True)
    points = torch.tensor(hull_of(problem.points).vertices, requires_grad=True)
    rests = evaluate_rests(points, center, hull_of)
    hull = rests.hull
    sides = int(np.diff(hull.facet_start).max())
    stretch = rng.normal(size=(3, 3))
    along = (hull.vertices - hull.centroid) @ stretch.T
    if center is not None or sides == 3:
        along = float(norms(along).max()) * rng.normal(size=along.shape)
    center_along = float(with_center) * rng.normal(size=3)
    motion = corner_motion(hull, problem.center, along, center_along)
    exact = derivative(motion).astype(np.float64)
    variables = [rests.vertices] if center is None else [rests.vertices, center]
    slopes, by_center, size = [], [], 0.0
    for one in rests.probabilities:
        parts = torch.autograd.grad(one, variables, retain_graph=True)
        by_center.append(float(parts[1].numpy() @ center_along) if center is not None else 0.0)
        slopes.append(float(np.vdot(parts[0].numpy(), along)) + by_center[-1])
        size = max(size, sum(float((part**2).sum()) for part in parts) ** 0.5)
    jacobian = rests.jacobian @ along.ravel() + by_center
    errors = {
        "gradient": relative_error(rests, np.array(slopes), exact),
        "Jacobian": relative_error(rests, jacobian, exact),
    }
    if sides > 3 and not is_file:
        errors["half-spaces"] = half_space_error(hull, problem.center, stretch, rng)
        if center is not None:
            broken = derivative(motion, broken=True).astype(np.float64)
            errors["broken"] = relative_error(rests, jacobian, broken)
    limit = ERROR_FLOOR
    if max(errors.values()) > limit:
        condition = derivative_condition(hull, problem.center, along, center_along)
        limit = max(limit, CONDITION_FACTOR * condition * float(np.finfo(np.float64).eps))
    radius = float(norms(hull.vertices - rests.equilibria.center_of_mass).max())
    return Comparison(sides, errors, size * radius, limit)


def half_space_error(
    hull: ConvexHull, center: Floats | None, stretch: Floats, rng: np.random.Generator
) -> float:
    """Largest error of the derivatives where the half-spaces of a hull move."""
    coordinates, parameters = FacetCoordinates.of(hull.vertices, hull.centroid)
    if (np.bincount(hull.tail) == 3).all():
        along = rng.normal(size=parameters.shape)
    else:
        # (n - t A^T n) . x = d: of the unit normal the logarithm of d grows with t n . A^T n.
        normals = parameters[: 3 * len(hull.normals)].reshape(-1, 3)
        turning = normals @ stretch
        along = np.concatenate([-turning.ravel(), (normals * turning).sum(axis=1)])
    shape = coordinates.shape(parameters)
    given = None if center is None else torch.tensor(center)
    rests = evaluate_rests(torch.tensor(shape.points, requires_grad=True), given)
    jacobian = shape.in_parameters(rests.jacobian, rests.hull.source)
    motion = half_space_motion(rests.hull, center, coordinates.origin, parameters, along)
    return relative_error(rests, jacobian @ along, derivative(motion).astype(np.float64))


def relative_error(rests: RestEvaluation, computed: Floats, exact: Floats) -> float:
    """Largest difference of derivatives (k,) of the rests from those (m,) of all facets, over the
    largest of these."""
    of_facets = np.zeros(len(exact))
    of_facets[rests.paths.rests] = computed
    return float(np.abs(of_facets - exact).max() / np.abs(exact).max())


def compare_many(name: str, compared: Iterable[tuple[str, Comparison]], report: Report) -> bool:
    """A row for each group of bodies, and for all."""
    groups: dict[str, list[Comparison]] = {"all": []}
    for group, one in compared:
        groups.setdefault(group, []).append(one)
        groups["all"].append(one)
    kinds = ("gradient", "Jacobian", "broken", "half-spaces")
    row = report.table(
        name,
        f"{name} 30s | bodies 6d | sides 5d | median 9.1e | gradient 9.1e | Jacobian 9.1e | "
        "broken 9.1e | half-spaces 9.1e | not ok 6d",
    )
    for group, ones in groups.items():
        median = float(np.median([one.errors["gradient"] for one in ones]))
        worst = [
            max((one.errors[kind] for one in ones if kind in one.errors), default=None)
            for kind in kinds
        ]
        wrong = sum(not one.is_right for one in ones)
        row(group, len(ones), max(one.sides for one in ones), median, *worst, wrong)
    return all(one.is_right for one in groups["all"])


def random_hulls(count: int) -> Iterator[tuple[str, Comparison]]:
    """Random hulls of triangles, by kind."""
    for number in range(count):
        kind, problem = random_hull(number)
        what = "uniform" if problem.center is None else "given center"
        yield f"{kind}, {what}", compare(problem, seed=number, with_center=True)


def polygons(named: int | None, random: int) -> Iterator[tuple[str, Comparison]]:
    """Bodies with facets of many sides, each with and without a given center of mass."""
    for name, body in islice(polygon_bodies(), named):
        for problem in (body, with_center(body, 0)):
            is_file = name.endswith("as a file")
            yield name.removesuffix(", turned"), compare(problem, seed=0, is_file=is_file)
    for number in range(random):
        body = random_polyhedron(number)
        problem = body if number % 2 == 0 else with_center(body, number)
        yield "random polyhedra", compare(problem, seed=number)


def polygon_bodies() -> Iterator[tuple[str, Problem]]:
    """Uniform dice and solids, as they are and turned, and dice in single precision."""
    named = {
        "cube": solids.platonic("cube").points,
        "box 1 x 2 x 3": solids.box(1.0, 2.0, 3.0).points,
        "octahedron": solids.platonic("octahedron").points,
        "dodecahedron": solids.platonic("dodecahedron").points,
        **{f"prism {sides}": solids.prism(sides).points for sides in (3, 5, 12)},
        "antiprism 5": solids.antiprism(5).points,
        "truncated octahedron": solids.archimedean("truncated octahedron").points,
        "prism with caps": prism(5).points,
    }
    dice = {
        "2d6 hendecahedron": hendecahedron("bisymmetric").points,
        **{f"{facets} facets apart": repulsion(facets, 0).points for facets in (12, 20)},
    }
    for number, (name, points) in enumerate({**named, **dice}.items()):
        yield name, Problem(points)
        yield f"{name}, turned", rotate_problem(Problem(points), number)
    for name, points in dice.items():
        yield f"{name}, as a file", Problem(points.astype(np.float32).astype(np.float64))


def with_center(body: Problem, seed: int) -> Problem:
    """The body with a given center of mass near its centroid."""
    hull = convex_hull(body.points)
    aside = unit_vectors(np.random.default_rng([seed, 1]).normal(size=3))
    offset = OFF_CENTER * float(hull.heights(hull.centroid).min())
    return Problem(body.points, hull.centroid + offset * aside)


def random_polyhedron(number: int) -> Problem:
    """Random half-spaces, 5 to 24 of them, whose corners three facets share."""
    rng = np.random.default_rng([21, number])
    while True:
        facets = int(rng.integers(5, 25))
        normals = unit_vectors(rng.normal(size=(facets, 3)))
        try:
            hull = convex_hull(polyhedron_corners(normals, np.exp(0.2 * rng.normal(size=facets))))
        except (ArithmeticError, ValueError):
            continue
        rests = evaluate_rests(torch.tensor(hull.vertices))
        if np.abs(hull.vertices).max() < 10.0 and len(rests.paths.rests) > 1:
            return Problem(hull.vertices)


def compare_growths(count: int, report: Report) -> bool:
    """Bodies in which rho vanishes alone, crossed and just not, and others in which alpha does
    too: of four offsets alpha / rho the one with the largest gradient."""
    row = report.table(
        "growths",
        "path 10s | r_p . v 9.1e | gradient 9.1e | error 9.1e | limit 9.1e",
    )
    sizes, is_good = [], True
    for power in range(1, count + 1):
        growth = 10.0**-power
        grazing = [
            rotate_problem(grazing_body(growth, ratio * growth), power)
            for ratio in (0.01, 0.1, 1.0, 10.0)
            if ratio * growth <= 0.1
        ]
        rows = [("glancing", sign * growth, [glancing(sign * growth)]) for sign in (1.0, -1.0)]
        if power < count:
            rows.append(("grazing", growth, grazing))
        for name, rho, problems in rows:
            steepest = max(
                (compare(one, seed=0, with_center=True) for one in problems), key=lambda c: c.size
            )
            row(name, rho, steepest.size, max(steepest.errors.values()), steepest.limit)
            is_good &= steepest.is_right
            if name == "grazing" and power >= 3:
                sizes.append((np.log(rho), np.log(steepest.size)))
    exponent = float(np.polyfit(*np.transpose(sizes), 1)[0])
    report.line(f"the gradient of grazing paths grows like (r_p . v)^{exponent:.4f}")
    report.record["grazing exponent"] = exponent
    return is_good


def time_derivatives(seconds: float, report: Report) -> None:
    """Times of derivatives, as multiples of that of the hull, which all include."""
    row = report.table(
        "times",
        "times hull 28s | rests 5d | hull ms 9.4f | probabilities 9.2f | gradient 9.2f | "
        "Jacobian 9.2f | 1 by 1 9.2f | half-spaces 9.2f",
    )
    for name, points in {
        "cube": solids.platonic("cube").points,
        "2d6 hendecahedron": hendecahedron("bisymmetric").points,
        "30 facets apart": repulsion(30, 0).points,
        "ellipsoid of 1,000 points": large(1000).points,
    }.items():
        hull, *others = time_in_turn(works_of(points), seconds)
        rests = len(evaluate_rests(torch.tensor(points)).probabilities)
        row(name, rests, 1e3 * hull, *(taken / hull for taken in others))


def works_of(points: Floats) -> list[Callable[[], Any]]:
    """The hull, the probabilities, the gradient of one weighted sum of them, those of all at once,
    one by one, and from half-spaces and in these."""
    rests = evaluate_rests(torch.tensor(points))
    coordinates, parameters = FacetCoordinates.of(rests.hull.vertices, rests.hull.centroid)

    def evaluate() -> RestEvaluation:
        return evaluate_rests(torch.tensor(points, requires_grad=True))

    def gradient() -> Any:
        evaluation = evaluate()
        return torch.autograd.grad((evaluation.probabilities**2).sum(), evaluation.vertices)

    def one_by_one() -> Any:
        evaluation = evaluate()
        return [
            torch.autograd.grad(value, evaluation.vertices, retain_graph=True)
            for value in evaluation.probabilities
        ]

    def half_spaces() -> Any:
        shape = coordinates.shape(parameters)
        evaluation = evaluate_rests(torch.tensor(shape.points))
        return shape.in_parameters(evaluation.jacobian, evaluation.hull.source)

    return [
        lambda: convex_hull(points),
        lambda: evaluate().probability_values,
        gradient,
        lambda: evaluate().jacobian,
        one_by_one,
        half_spaces,
    ]
