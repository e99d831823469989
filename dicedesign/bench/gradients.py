"""Gradients of probabilities against differences of the 60-digit oracle, hull by hull."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from dicedesign.bench.condition import condition
from dicedesign.bench.crossings import smallest_growth_and_slant
from dicedesign.bench.differences import oracle_derivative
from dicedesign.bench.problem import Problem
from dicedesign.bench.random_hulls import random_hull
from dicedesign.design.differentiable import RestEvaluation, evaluate_rests
from dicedesign.geometry.sphere import norms

__all__ = ["MEDIAN_LIMIT", "GradientRow", "compare_gradients", "gradient_row", "is_sound"]

Floats = NDArray[np.float64]

MEDIAN_LIMIT: Final = 1e-8
"""Of the relative errors of many hulls."""

ERROR_FLOOR: Final = 1e-13
"""A smaller relative error is within the limit on any hull."""

CONDITION_FACTOR: Final = 10.0
"""Else it may be so many times the gradient's own condition times machine epsilon."""


@dataclass(frozen=True)
class GradientRow:
    """How right the derivatives of one body's probabilities are, all coordinates moving at once.

    Attributes
    ----------
    name: of the body; corners: how many; rests: how many.
    uniform: whether its center of mass follows from its corners, or is a variable of its own.
    size: largest norm of a probability's gradient, times the body's radius.
    error: largest error of a probability's derivative over the largest such derivative.
    limit: what the error may be.
    condition: of the probabilities, see `dicedesign.bench.condition`.
    gradient_condition: relative change of the largest derivative over the relative size of the
        change of coordinates that causes it, to first order, at most.
    growth, slant: see `dicedesign.bench.crossings`.
    """

    name: str
    corners: int
    rests: int
    uniform: bool
    size: float
    error: float
    limit: float
    condition: float
    gradient_condition: float
    growth: float
    slant: float

    @property
    def ok(self) -> bool:
        """Whether the error is within its limit."""
        return self.error <= self.limit


def compare_gradients(hulls: int) -> Iterator[GradientRow]:
    """Rows of so many random hulls, as they come."""
    for number in range(hulls):
        kind, problem = random_hull(number)
        yield gradient_row(f"{kind} {number}", problem, seed=number)


def is_sound(rows: list[GradientRow]) -> bool:
    """Whether the median error is within `MEDIAN_LIMIT` and each one within its own limit."""
    median = float(np.median([row.error for row in rows]))
    return median <= MEDIAN_LIMIT and all(row.ok for row in rows)


def gradient_row(name: str, problem: Problem, seed: int = 0) -> GradientRow:
    """Compare one body's derivatives in a random direction of all its coordinates.

    problem: with at least two rests and triangles only.
    """
    rng = np.random.default_rng([seed, len(problem.points)])
    points = torch.tensor(problem.points, requires_grad=True)
    center = None if problem.center is None else torch.tensor(problem.center, requires_grad=True)
    rests = evaluate_rests(points, center)
    hull, middle = rests.hull, rests.equilibria.center_of_mass
    reaches = norms(hull.vertices - middle)
    radius = float(reaches.max())
    along = np.zeros((len(problem.points), 3))
    along[hull.source] = radius * rng.normal(size=(len(hull.source), 3))
    center_along = radius * rng.normal(size=3)

    variables = [points] if center is None else [points, center]
    velocities = [torch.tensor(along), torch.tensor(center_along)][: len(variables)]
    found, bends, size = _derivatives(rests, variables, velocities)
    exact = oracle_derivative(hull, problem.center, along[hull.source], center_along)
    largest = float(np.abs(exact).max())
    all_found = np.zeros(len(exact))
    all_found[rests.paths.rests] = found
    distances = np.zeros(len(along))
    distances[hull.source] = reaches
    gradient_condition = float((bends @ distances).max()) / largest
    epsilon = float(np.finfo(np.float64).eps)
    growth, slant = smallest_growth_and_slant(rests.paths, hull.vertices, middle)
    return GradientRow(
        name=name,
        corners=len(hull.vertices),
        rests=len(found),
        uniform=center is None,
        size=size * radius,
        error=float(np.abs(all_found - exact).max()) / largest,
        limit=max(ERROR_FLOOR, CONDITION_FACTOR * gradient_condition * epsilon),
        condition=condition(hull, middle, rests.paths),
        gradient_condition=gradient_condition,
        growth=growth,
        slant=slant,
    )


def _derivatives(
    rests: RestEvaluation, variables: list[torch.Tensor], velocities: list[torch.Tensor]
) -> tuple[Floats, Floats, float]:
    """Derivatives (k,) of the probabilities, how fast each changes with each point at most (k, n),
    and the largest norm of a probability's gradient."""
    derivatives, bends, size = [], [], 0.0
    for probability in rests.probabilities:
        gradients = torch.autograd.grad(probability, variables, retain_graph=True)
        pairs = list(zip(gradients, velocities, strict=True))
        derivatives.append(sum(float((g * v).sum()) for g, v in pairs))
        size = max(size, sum(float((g**2).sum()) for g in gradients) ** 0.5)
        slopes = torch.autograd.grad(probability, variables, create_graph=True)
        along = [(g * v).sum() for g, v in zip(slopes, velocities, strict=True)]
        (bend,) = torch.autograd.grad(torch.stack(along).sum(), variables[0], retain_graph=True)
        bends.append(bend.abs().sum(dim=1).numpy())
    return np.array(derivatives), np.array(bends), size
