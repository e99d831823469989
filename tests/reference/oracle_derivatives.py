"""Derivatives of probabilities as differences of the 60-digit oracle.

Where corners move, a facet of more than three sides may not stay flat. Its derivative is that of
the sum over the triangles into which it breaks (`broken_derivative`): no border of a basin depends
on how. So it is also that of the polygon whose sides stay (`derivative`). Only the center of mass
of a uniform solid depends on how, as the volume under the facet does; there the derivatives are
those for motions that keep facets flat, as linear maps and moving half-spaces do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats
from tests.reference.oracle import (
    DIGITS,
    Number,
    OracleError,
    Vector,
    cross,
    dot,
    facet_polygons,
    minus,
    multiprecision,
    oracle_probabilities,
    plus,
    solid_centroid,
    times,
    unit,
    vector,
)

STEP: Final = "1e-20"
"""Part of the displacement that is taken to both sides: the difference quotient is off by about its
square, and by the oracle's 1e-60 over it."""

Polygons = Sequence[Sequence[int]]


@dataclass(frozen=True)
class Motion:
    """A body that changes with time.

    Attributes
    ----------
    polygons: corners of each facet, counter-clockwise seen from outside.
    at: the corners and the center of mass at a time, all in 60 digits.
    """

    polygons: Polygons
    at: Callable[[Number], tuple[list[Vector], Vector]]


def oracle_derivative(
    hull: ConvexHull, center: Floats | None, along: Floats, center_along: Floats
) -> Floats:
    """Derivative (m,) of the probability of each facet, right to all digits of float64.

    The facets stay those of the hull, as they do for any displacement small enough.

    hull: the body; a uniform one with facets of more than three sides only if these stay flat.
    center: (3,) center of mass, or None for that of the uniform solid, which then moves as the
        corners make it.
    along: (n, 3) velocity of each corner.
    center_along: (3,) that of a given center; without meaning for a uniform one.

    Raises OracleError where the body balances exactly.
    """
    return as_floats(derivative(corner_motion(hull, center, along, center_along)))


def as_floats(numbers: Sequence[Number]) -> Floats:
    """Numbers (m,) in float64."""
    return np.array([float(number) for number in numbers])


def derivative(motion: Motion) -> list[Number]:
    """Derivative of the probability of each facet at time 0; m numbers."""
    return _derivative(motion, lambda corners: (motion.polygons, range(len(motion.polygons))))


def broken_derivative(motion: Motion) -> list[Number]:
    """The same with every facet broken into the triangles of the convex hull of its corners."""

    def broken(corners: list[Vector]) -> tuple[Polygons, Sequence[int]]:
        parts = [_triangles(corners, polygon) for polygon in motion.polygons]
        owner = [facet for facet, triangles in enumerate(parts) for _ in triangles]
        return [triangle for triangles in parts for triangle in triangles], owner

    return _derivative(motion, broken)


def corner_motion(
    hull: ConvexHull,
    center: Floats | None,
    along: Floats,
    center_along: Floats,
    moved: Sequence[Vector] | None = None,
) -> Motion:
    """A body whose corners and center of mass move evenly; see `oracle_derivative`.

    moved: corners in 60 digits to begin with, if not those of the hull.
    """
    polygons, triangles = facet_polygons(hull), hull.triangles.tolist()
    with multiprecision().workdps(DIGITS):
        start = [vector(x) for x in hull.vertices.tolist()] if moved is None else moved
        velocities = [vector(v) for v in along.tolist()]

    def at(time: Number) -> tuple[list[Vector], Vector]:
        corners = [plus(x, times(time, v)) for x, v in zip(start, velocities, strict=True)]
        if center is None:
            return corners, solid_centroid(corners, triangles)
        middle = plus(vector(center.tolist()), times(time, vector(center_along.tolist())))
        return corners, middle

    return Motion(polygons, at)


def half_space_motion(
    hull: ConvexHull, center: Floats | None, origin: Floats, parameters: Floats, along: Floats
) -> Motion:
    """A body that is the intersection of half-spaces, which move evenly in `FacetCoordinates`.

    hull: the body. center: (3,) center of mass at rest, or None for that of the uniform solid.
    origin: (3,) of the coordinates. parameters: (4 m,) of them; along: (4 m,) their velocity. Where
    more than three facets meet in a corner, the velocity is to keep it so.
    """
    count = len(parameters) // 4
    units = parameters[: 3 * count].reshape(count, 3)
    units = units / np.sqrt((units**2).sum(axis=1))[:, None]
    polygons, triangles = facet_polygons(hull), hull.triangles.tolist()
    planes = np.argmax(hull.normals @ units.T, axis=1)
    meeting = [
        _three(units, [int(planes[f]) for f, one in enumerate(polygons) if corner in one])
        for corner in range(len(hull.vertices))
    ]

    def at(time: Number) -> tuple[list[Vector], Vector]:
        number, exp = multiprecision().mpf, multiprecision().exp
        moved = [
            number(p) + time * number(v)
            for p, v in zip(parameters.tolist(), along.tolist(), strict=True)
        ]
        normals = [unit((moved[3 * i], moved[3 * i + 1], moved[3 * i + 2])) for i in range(count)]
        heights = [exp(logarithm) for logarithm in moved[3 * count :]]
        middle = vector(origin.tolist())
        corners = [
            plus(middle, _meeting_point([normals[i] for i in three], [heights[i] for i in three]))
            for three in meeting
        ]
        if center is None:
            return corners, solid_centroid(corners, triangles)
        return corners, vector(center.tolist())

    return Motion(polygons, at)


def _derivative(
    motion: Motion, facets: Callable[[list[Vector]], tuple[Polygons, Sequence[int]]]
) -> list[Number]:
    """Derivative of the probability of each facet.

    facets: from corners to polygons, and the facet that each of these is a part of.
    """
    with multiprecision().workdps(DIGITS):
        step = multiprecision().mpf(STEP)
        total = [0 * step for _ in motion.polygons]
        for time in (step, -step):
            corners, center = motion.at(time)
            polygons, owner = facets(corners)
            for facet, p in zip(
                owner, oracle_probabilities(corners, polygons, [center]), strict=True
            ):
                total[facet] += p / (2 * time)
        return total


def _triangles(corners: Sequence[Vector], polygon: Sequence[int]) -> list[Sequence[int]]:
    """The upper side of the convex hull of a nearly flat polygon's corners."""
    if len(polygon) == 3:
        return [polygon]
    first, last = polygon[0], polygon[-1]
    to_last = minus(corners[last], corners[first])
    best = 1
    for place in range(2, len(polygon) - 1):
        normal = cross(minus(corners[polygon[best]], corners[first]), to_last)
        if dot(normal, minus(corners[polygon[place]], corners[first])) > 0:
            best = place
    parts: list[Sequence[int]] = [(first, polygon[best], last)]
    for side in (polygon[: best + 1], polygon[best:]):
        parts += _triangles(corners, side) if len(side) > 2 else []
    return parts


def _three(units: Floats, planes: Sequence[int]) -> tuple[int, ...]:
    """Of planes with normals (m, 3) that meet in a corner the three that are least in line."""
    return max(combinations(planes, 3), key=lambda three: abs(np.linalg.det(units[list(three)])))


def _meeting_point(normals: Sequence[Vector], heights: Sequence[Number]) -> Vector:
    """Where three planes meet, by Cramer's rule."""
    a, b, c = normals
    total = vector((0, 0, 0))
    for height, plane in zip(heights, (cross(b, c), cross(c, a), cross(a, b)), strict=True):
        total = plus(total, times(height, plane))
    return times(1 / dot(a, cross(b, c)), total)


MOVE: Final = "1e-25"
"""Relative size of the changes: no decision lies that near, and enough digits are left."""

TRIALS: Final = 3


def probability_condition(hull: ConvexHull, center: Floats) -> float:
    """Largest change of a probability over the relative size of the change of coordinates.

    Every corner is moved by a part of its distance from the center of mass (3,), in random
    directions along the axes: an estimate from below. 0 where the oracle has no answer.
    """
    polygons = facet_polygons(hull)
    with multiprecision().workdps(DIGITS):
        step = multiprecision().mpf(MOVE)
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
        step = multiprecision().mpf(MOVE)
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
