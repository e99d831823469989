"""What hulls and exact arithmetic cost where they are not needed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.bench.cost import Row, time_row
from dicedesign.bench.extremes import large
from dicedesign.bench.stopwatch import in_turn
from dicedesign.design.coordinates import FacetCoordinates
from dicedesign.design.starts import hendecahedron
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.geometry.hull_reuse import HullMemory
from dicedesign.rest.equilibria import classify
from dicedesign.rest.exact import ExactSigns
from dicedesign.rest.morse import separatrices

__all__ = ["exact_rows", "hull_rows"]

Floats = NDArray[np.float64]


def hull_rows(seconds: float) -> Iterator[Row]:
    """Hulls of points that move a little to and fro, as in a descent: a die's corners, of which
    more than three lie on a facet, and points of which many are near to changing neighbors."""
    start = hendecahedron("bisymmetric")
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    rng = np.random.default_rng(0)
    parameters = parameters + 1e-2 * rng.normal(size=parameters.shape)
    die = [
        coordinates.shape(place).points
        for place in (parameters, parameters + 1e-4 * rng.normal(size=parameters.shape))
    ]
    points = large(500).points
    cloud = [points, points + 1e-6 * rng.normal(size=points.shape)]
    for name, places in (("die of 11 facets", die), ("hull of 500 points", cloud)):
        yield _hull_row(name, places, seconds / 2.0)


def _hull_row(name: str, places: Sequence[Floats], seconds: float) -> Row:
    memory = HullMemory()
    reused, rebuilt = in_turn(
        [
            lambda: [memory.hull(place) for place in places],
            lambda: [convex_hull(place) for place in places],
        ],
        seconds,
    )
    share = memory.reused / (memory.reused + memory.built)
    name = f"{name}, edges last in {100.0 * share:.0f} %"
    return time_row("hull rebuilt though its edges last", name, reused / 2.0, rebuilt / 2.0)


class _CountingSigns(ExactSigns):
    """Exact decisions, counted."""

    calls = 0

    def growth(self, half_edge: int) -> int:
        self.calls += 1
        return super().growth(half_edge)

    def side(self, half_edge: int) -> int:
        self.calls += 1
        return super().side(half_edge)

    def ascend(self, elements: Any, saddle: int, vertex: int) -> tuple[list[int], int]:
        self.calls += 1
        return super().ascend(elements, saddle, vertex)

    def descend(self, elements: Any, facet: int) -> int:
        self.calls += 1
        return super().descend(elements, facet)


BALANCED: Final = np.array(
    [[s * x, s * y, s - 2.0] for s in (1.0, 3.0) for x in (1.0, -1.0) for y in (1.0, -1.0)]
)
"""Corners of a square frustum about the origin (8, 3): the origin's foot on the plane of each side
lies on that side's lower edge, exactly."""


def exact_rows(seconds: float) -> Iterator[Row]:
    """The same shape with its balances and, a little deformed, without."""
    noise = 1e-3 * np.random.default_rng(0).normal(size=BALANCED.shape)
    hulls = [convex_hull(BALANCED + noise), convex_hull(BALANCED)]

    def trace(hull: ConvexHull) -> int:
        signs = _CountingSigns(hull, np.zeros(3))
        equilibria = classify(hull, np.zeros(3))
        equilibria.__dict__["exact"] = signs
        separatrices(equilibria)
        return signs.calls

    counts = [trace(hull) for hull in hulls]
    times = in_turn([partial(trace, hull) for hull in hulls], seconds / 2.0)
    feature = "exact arithmetic, for what rounding leaves open"
    yield Row(feature, "square frustum: decisions", "calls", counts[0], counts[1])
    yield time_row(feature, "square frustum: tracing", *times)
