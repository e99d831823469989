"""Times of derivatives, as multiples of that of the hull."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import torch

from dicedesign.bench.measures.processes import in_turn
from dicedesign.bench.rows import Row, column, milliseconds
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.optimize.starts.repulsion import repulsion
from dicedesign.runtime.arrays import Floats
from tests.reference.extremes import large
from tests.reference.solids import platonic

__all__ = ["GradientTimesRow", "gradient_times"]


@dataclass(frozen=True)
class GradientTimesRow(Row):
    """What derivatives of one uniform body cost, in seconds of the processor.

    Attributes
    ----------
    name: of the body; corners: how many; rests: how many.
    hull_seconds: this package's convex hull of the corners.
    odds: times as long for the odds from the points, hull included.
    one: the same with the gradient of one weighted sum of the odds.
    jacobian: the same with those of all odds at once.
    one_by_one: the same, a gradient at a time.
    half_spaces: the same from half-spaces and in these, with the hulls of both.
    """

    table: ClassVar[str | None] = "times"

    name: str = column("times hull", -30)
    corners: int = column("corners", 8)
    rests: int = column("rests", 6)
    hull_seconds: float = column("hull ms", 10, milliseconds)
    odds: float = column("odds", 9, ".2f")
    one: float = column("gradient", 9, ".2f")
    jacobian: float = column("Jacobian", 9, ".2f")
    one_by_one: float = column("1 by 1", 9, ".2f")
    half_spaces: float = column("half-sp.", 9, ".2f")


def gradient_times(seconds: float) -> Iterator[GradientTimesRow]:
    """Rows of dice and of a dense hull, each measured for about so many seconds."""
    bodies = {
        "cube": platonic("cube").points,
        "2d6 hendecahedron": hendecahedron("bisymmetric").points,
        "30 facets apart": repulsion(30, 0).points,
        "ellipsoid of 1000 points": large(1000).points,
    }
    for name, points in bodies.items():
        yield _times(name, points, seconds)


def _times(name: str, points: Floats, seconds: float) -> GradientTimesRow:
    rests = evaluate_rests(torch.tensor(points))
    coordinates, parameters = FacetCoordinates.of(rests.hull.vertices, rests.hull.centroid)

    def evaluated() -> RestEvaluation:
        return evaluate_rests(torch.tensor(points, requires_grad=True))

    def one() -> Any:
        found = evaluated()
        return torch.autograd.grad((found.probabilities**2).sum(), found.vertices)

    def one_by_one() -> Any:
        found = evaluated()
        return [
            torch.autograd.grad(value, found.vertices, retain_graph=True)
            for value in found.probabilities
        ]

    def half_spaces() -> Any:
        shape = coordinates.shape(parameters)
        found = evaluate_rests(torch.tensor(shape.points))
        return shape.in_parameters(found.jacobian, found.hull.source)

    works: list[Callable[[], Any]] = [
        lambda: convex_hull(points),
        lambda: evaluated().odds,
        one,
        lambda: evaluated().jacobian,
        one_by_one,
        half_spaces,
    ]
    hull, *others = in_turn(works, seconds)
    corners, count = len(rests.hull.vertices), len(rests.odds)
    return GradientTimesRow(name, corners, count, hull, *(taken / hull for taken in others))
