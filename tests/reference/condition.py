"""How much a body's probabilities, and their derivatives, magnify a change of its coordinates, by
differences of the 60-digit oracle: bounds on what rounding explains that owe nothing to the model
that they judge."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats
from tests.reference.oracle import facet_polygons, oracle_probabilities
from tests.reference.oracle_derivatives import corner_motion, derivative
from tests.reference.sixty_digits import (
    DIGITS,
    Number,
    OracleError,
    Vector,
    multiprecision,
    plus,
    times,
    vector,
)

__all__ = ["derivative_condition", "probability_condition"]

STEP: Final = "1e-25"
"""Relative size of the changes: no decision lies that near, and enough digits are left."""

TRIALS: Final = 3


def probability_condition(hull: ConvexHull, center: Floats) -> float:
    """Largest change of a probability over the relative size of the change of coordinates.

    Every corner is moved by a part of its distance from the center of mass (3,), in random
    directions along the axes: an estimate from below. 0 where the oracle has no answer.
    """
    polygons = facet_polygons(hull)
    with multiprecision().workdps(DIGITS):
        step = multiprecision().mpf(STEP)
        try:
            before, *others = (
                oracle_probabilities(corners, polygons, [center.tolist()])
                for corners in _moved(hull, center, (0, *[step] * TRIALS))
            )
        except OracleError:
            return 0.0
        return float(max(_largest_change(before, after) for after in others) / step)


def derivative_condition(
    hull: ConvexHull, center: Floats | None, along: Floats, center_along: Floats
) -> float:
    """Relative change of the largest derivative of a probability over the relative size of the
    change of coordinates, estimated in the same way.

    The arguments are those of `oracle_derivative`; raises the same.
    """
    middle = hull.centroid if center is None else center
    with multiprecision().workdps(DIGITS):
        step = multiprecision().mpf(STEP)
        before, *others = (
            derivative(corner_motion(hull, center, along, center_along, corners))
            for corners in _moved(hull, middle, (0, *[step] * TRIALS))
        )
        change = max(_largest_change(before, after) for after in others)
        return float(change / step / max(map(abs, before)))


def _largest_change(before: Sequence[Number], after: Sequence[Number]) -> Number:
    return max(abs(p - q) for p, q in zip(before, after, strict=True))


def _moved(hull: ConvexHull, center: Floats, steps: Sequence[Any]) -> Iterator[list[Vector]]:
    """Corners of a hull, each moved by a part of its distance from a center (3,), in random
    directions along the axes."""
    rng = np.random.default_rng(0)
    reaches = norms(hull.vertices - center)[:, None]
    for step in steps:
        moves = (reaches * rng.choice([-1.0, 1.0], size=hull.vertices.shape)).tolist()
        yield [
            plus(vector(x), times(step, vector(move)))
            for x, move in zip(hull.vertices.tolist(), moves, strict=True)
        ]
