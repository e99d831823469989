"""Gradients of probabilities against differences of the 60-digit oracle, and how they grow where a
flow line hardly climbs.

A flow line in the cell of p comes from u and crosses the arc of an edge vector v at
u' = u (r_p . v) - r_p (u . v). Take u, r_p, v as unit vectors, rho = r_p . v >= 0,
alpha = -u . v >= 0, and theta < 90 degrees between u and r_p. Then u' = rho u + alpha r_p lies at
an angle phi from r_p with tan phi = rho sin theta / (alpha + rho cos theta), so that

    d phi = sin theta (alpha d rho - rho d alpha) / |u'|^2,
    |u'|^2 = rho^2 + alpha^2 + 2 rho alpha cos theta >= rho^2 + alpha^2,

and |d phi| <= |d (rho, alpha)| / sqrt(rho^2 + alpha^2): about one over the slant, the sine of the
angle between line and arc, which is rho / sin phi = |u'| / sin theta. So rho -> 0 alone is
harmless: the crossing tends to r_p itself and d phi / d rho to sin theta / alpha. The gradient
grows like 1 / rho only where alpha vanishes too: where a line enters the cell next to the arc's
end, a facet's normal. `grazing_body` is such a body. In the next cell the line turns towards r_q by
an angle that stays away from 0 (r_q . v >= |v|^2), so the area inherits the growth; where several
crossings graze at once, their factors multiply.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np
import torch

from dicedesign.bench.measures.gradients.path_angles import smallest_growth_and_slant
from dicedesign.bench.rows import Row, column, hidden
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.runtime.arrays import Floats
from tests.reference.condition import derivative_condition, probability_condition
from tests.reference.oracle_derivatives import oracle_derivative
from tests.reference.problem import Problem, turned
from tests.reference.random_hulls import random_hull
from tests.reference.stiff import glancing

__all__ = [
    "GROWTHS",
    "MEDIAN_LIMIT",
    "GradientRow",
    "compare_gradients",
    "error_limit",
    "exponent",
    "glancing_rows",
    "gradient_row",
    "grazing_body",
    "grazing_rows",
    "is_sound",
]

MEDIAN_LIMIT: Final = 1e-8
"""Of the relative errors of many hulls."""

ERROR_FLOOR: Final = 1e-13
"""A smaller relative error is within the limit on any hull."""

CONDITION_FACTOR: Final = 10.0
"""Else it may be so many times the gradient's own condition times machine epsilon."""


def error_limit(error: float, condition: Callable[[], float]) -> float:
    """What a relative error may be; the condition is only asked for a large one."""
    if error <= ERROR_FLOOR:
        return ERROR_FLOOR
    return max(ERROR_FLOOR, CONDITION_FACTOR * condition() * float(np.finfo(np.float64).eps))


@dataclass(frozen=True)
class GradientRow(Row):
    """How right the derivatives of one body's probabilities are, all coordinates moving at once.

    Attributes
    ----------
    name: of the body; corners: how many; rests: how many.
    uniform: whether its center of mass follows from its corners, or is a variable of its own.
    size: largest norm of a probability's gradient, times the body's radius; scaled_size: times the
        size of the growth too.
    error: largest error of a probability's derivative over the largest such derivative, with
        gradients one by one; jacobian_error: with those in the corners by
        `RestEvaluation.jacobian`.
    limit: what the errors may be.
    condition: of the probabilities, see `tests.reference.condition`; NaN if not asked.
    growth, slant: see `dicedesign.bench.measures.gradients.path_angles`.
    """

    table: ClassVar[str | None] = None
    computed: ClassVar[tuple[str, ...]] = ("ok",)

    name: str = column("path", -26)
    corners: int = hidden()
    rests: int = hidden()
    uniform: bool = hidden()
    growth: float = column("r_p . v", 11, ".1e")
    slant: float = column("slant", 11, ".1e")
    size: float = column("gradient", 11, ".1e")
    scaled_size: float = column("x r_p . v", 11, ".1e")
    error: float = column("error", 11, ".1e")
    jacobian_error: float = column("Jacobian", 11, ".1e")
    limit: float = column("limit", 11, ".1e")
    condition: float = column("condition", 11, ".1e", default=float("nan"))

    @property
    def ok(self) -> bool:
        """Whether the errors are within their limit."""
        return max(self.error, self.jacobian_error) <= self.limit


def compare_gradients(hulls: int) -> Iterator[GradientRow]:
    """Rows of so many random hulls, as they come."""
    for number in range(hulls):
        kind, problem = random_hull(number)
        yield gradient_row(f"{kind} {number}", problem, seed=number)


def is_sound(rows: list[GradientRow]) -> bool:
    """Whether the median error is within `MEDIAN_LIMIT` and each one within its own limit."""
    median = float(np.median([row.error for row in rows]))
    return median <= MEDIAN_LIMIT and all(row.ok for row in rows)


def gradient_row(
    name: str,
    problem: Problem,
    seed: int = 0,
    evaluate: Callable[[torch.Tensor, torch.Tensor | None], RestEvaluation] = evaluate_rests,
) -> GradientRow:
    """Compare one body's derivatives in a random direction of all its coordinates.

    problem: with at least two rests and triangles only. evaluate: what is compared.
    """
    rng = np.random.default_rng([seed, len(problem.points)])
    points = torch.tensor(problem.points, requires_grad=True)
    center = None if problem.center is None else torch.tensor(problem.center, requires_grad=True)
    rests = evaluate(points, center)
    hull, middle = rests.hull, rests.equilibria.center_of_mass
    radius = float(norms(hull.vertices - middle).max())
    along = np.zeros((len(problem.points), 3))
    along[hull.source] = radius * rng.normal(size=(len(hull.source), 3))
    center_along = radius * rng.normal(size=3)

    variables = [points] if center is None else [points, center]
    velocities = [torch.tensor(along), torch.tensor(center_along)][: len(variables)]
    motion = along[hull.source], center_along
    by_corners, by_center, size = _derivatives(rests, variables, velocities)
    exact = oracle_derivative(hull, problem.center, *motion)
    largest = float(np.abs(exact).max())
    jacobian = rests.jacobian @ along[hull.source].ravel()
    error, jacobian_error = (
        _difference(rests, corners + by_center, exact) for corners in (by_corners, jacobian)
    )
    growth, slant = smallest_growth_and_slant(rests.paths, hull.vertices, middle)
    return GradientRow(
        name=name,
        corners=len(hull.vertices),
        rests=len(by_corners),
        uniform=center is None,
        size=size * radius,
        scaled_size=size * radius * abs(growth),
        error=error / largest,
        jacobian_error=jacobian_error / largest,
        limit=error_limit(
            max(error, jacobian_error) / largest,
            lambda: derivative_condition(hull, problem.center, *motion),
        ),
        growth=growth,
        slant=slant,
    )


def _derivatives(
    rests: RestEvaluation, variables: list[torch.Tensor], velocities: list[torch.Tensor]
) -> tuple[Floats, Floats, float]:
    """Derivatives (k,) of the probabilities with the points and with a given center, and the
    largest norm of a probability's gradient."""
    derivatives, size = np.zeros((2, len(rests.probabilities))), 0.0
    for number, probability in enumerate(rests.probabilities):
        gradients = torch.autograd.grad(probability, variables, retain_graph=True)
        for part, (gradient, velocity) in enumerate(zip(gradients, velocities, strict=True)):
            derivatives[part, number] = float((gradient * velocity).sum())
        size = max(size, sum(float((g**2).sum()) for g in gradients) ** 0.5)
    return derivatives[0], derivatives[1], size


def _difference(rests: RestEvaluation, found: Floats, exact: Floats) -> float:
    """Largest difference of derivatives (k,) of the rests from those (m,) of all facets."""
    all_found = np.zeros(len(exact))
    all_found[rests.paths.rests] = found
    return float(np.abs(all_found - exact).max())


GROWTHS: Final = tuple(10.0**-power for power in range(1, 15))

OFFSETS: Final = (0.01, 0.1, 1.0, 10.0)
"""Tried for the offset over rho."""

LARGEST_OFFSET: Final = 0.1
"""With a larger one the center of mass leaves `grazing_body`."""

SMALL: Final = 1e-3
"""Growths up to which the exponent is fitted."""

HEIGHT: Final = 0.14
"""Of the center of mass over the bottom of `grazing_body`."""

TOP: Final = np.array([[-0.48, 0.41, 1.33], [-0.37, -0.57, 1.41], [-0.92, 1.58, 2.59]])
"""Its upper corners: with the height and the length of the legs about those with the largest
gradient of 4,000 bodies drawn at random."""


def glancing_rows(growths: int = len(GROWTHS)) -> Iterator[GradientRow]:
    """Bodies in which only rho vanishes, for the first of `GROWTHS`: crossed, and just not crossed
    (rho < 0)."""
    for sign in (1.0, -1.0):
        for growth in GROWTHS[:growths]:
            problem = glancing(sign * growth)
            row = _with_condition(gradient_row("glancing", problem), problem)
            beyond = replace(row, growth=-growth, scaled_size=row.size * growth)
            yield row if sign > 0.0 else beyond


def grazing_rows(growths: int = len(GROWTHS)) -> Iterator[GradientRow]:
    """For each rho the body of `grazing_body` with the largest gradient of all offsets, turned, so
    that its coordinates are rounded as those of any other body."""
    for number, growth in enumerate(GROWTHS[: growths - 1]):
        rows = []
        for ratio in OFFSETS:
            if ratio * growth <= LARGEST_OFFSET:
                problem = turned(grazing_body(growth, ratio * growth), number)
                row = gradient_row(f"grazing, offset {ratio:.3g} rho", problem)
                rows.append((row.size, _with_condition(row, problem)))
        yield max(rows, key=lambda sized: sized[0])[1]


def _with_condition(row: GradientRow, problem: Problem) -> GradientRow:
    hull = convex_hull(problem.points)
    center = hull.centroid if problem.center is None else problem.center
    return replace(row, condition=probability_condition(hull, center))


def grazing_body(growth: float, offset: float) -> Problem:
    """A body in which rho is a given growth and the saddle lies at a distance from the bottom's
    normal that is the offset times its height: alpha is about that distance.

    The bottom is a triangle with a nearly right angle at p, and the foot of the center of mass is
    at `offset` from the middle of one leg: the saddle's line enters the cell of p and leaves it
    across the other leg's arc.
    """
    center = np.array([0.5, offset, HEIGHT])
    reach = np.hypot(0.5, offset)
    tilt = np.arctan2(offset, 0.5) + np.arcsin(growth * np.hypot(reach, HEIGHT) / reach)
    leg = 1.3 * np.array([-np.sin(tilt), np.cos(tilt), 0.0])
    bottom = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], leg])
    return Problem(np.concatenate([bottom, TOP]), center)


def exponent(rows: list[GradientRow]) -> float:
    """Slope of the gradient's size over the growth, in logarithms, for small positive growths."""
    chosen = [row for row in rows if 0.0 < row.growth <= SMALL * 1.01]
    growths = np.log([row.growth for row in chosen])
    sizes = np.log([row.size for row in chosen])
    return float(np.polyfit(growths, sizes, 1)[0])
