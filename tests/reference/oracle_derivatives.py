"""Derivatives of probabilities as differences of the 60-digit oracle.

If corners move, a facet of more than three sides may not stay flat. The derivative of its
probability is the derivative of the sum over the triangles into which it breaks (`broken`), however
it breaks, as no border of a basin depends on that. So it is also the derivative for the polygon
(`derivative`). Only the center of mass of a uniform solid depends on the triangles; there the
derivatives are for motions that keep facets flat, such as linear maps and moving half-spaces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import mpmath
import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.runtime.arrays import Floats, Integers
from tests.reference.oracle import (
    DIGITS,
    Number,
    Numbers,
    OracleError,
    cross,
    exact,
    facet_polygons,
    oracle_probabilities,
    solid_centroid,
    unit,
)

STEP = "1e-20"
"""Step of the central differences: their errors are about its square, and 1e-60 over the step."""

Polygons = Sequence[Sequence[int]]


@dataclass(frozen=True)
class Motion:
    """A body that changes with time.

    Attributes
    ----------
    polygons: corners of each facet, counter-clockwise seen from outside.
    triangles: (t, 3) of the facets, for the center of mass of a uniform solid.
    corners: corners (n, 3) at a time, in 60 digits.
    center: center of mass (3,) at a time, or None for a uniform solid.
    """

    polygons: Polygons
    triangles: Integers
    corners: Callable[[Number], Numbers]
    center: Callable[[Number], Numbers] | None


def oracle_derivative(
    hull: ConvexHull, center: Floats | None, along: Floats, center_along: Floats
) -> Floats:
    """Derivative (m,) of the probability of each facet, exact in float64.

    The facets stay those of the hull, as for any small displacement.

    hull: the body; a uniform one with facets of more than three sides only if these stay flat.
    center: (3,) center of mass, or None for that of the uniform solid, which then moves as the
        corners make it.
    along: (n, 3) velocity of each corner.
    center_along: (3,) velocity of a given center; ignored for a uniform solid.

    Raises OracleError if the body balances exactly.
    """
    return derivative(corner_motion(hull, center, along, center_along)).astype(np.float64)


def derivative(motion: Motion, broken: bool = False) -> Numbers:
    """Derivative (m,) of the probability of each facet at time 0, in 60 digits.

    broken: with every facet broken into the triangles of the convex hull of its corners.
    """
    with mpmath.workdps(DIGITS):
        step, total = mpmath.mpf(STEP), exact(np.zeros(len(motion.polygons)))
        for time in (step, -step):
            corners, owner, polygons = motion.corners(time), [], []
            for facet, polygon in enumerate(motion.polygons):
                parts = _triangles(corners, polygon) if broken else [polygon]
                owner += [facet] * len(parts)
                polygons += parts
            center = (
                solid_centroid(corners, motion.triangles)
                if motion.center is None
                else motion.center(time)
            )
            probabilities = oracle_probabilities(corners, polygons, [center])
            for facet, probability in zip(owner, probabilities, strict=True):
                total[facet] += probability / (2 * time)
        return total


def corner_motion(
    hull: ConvexHull,
    center: Floats | None,
    along: Floats,
    center_along: Floats,
    start: Numbers | None = None,
) -> Motion:
    """A body whose corners and center of mass move evenly; see `oracle_derivative`.

    start: corners in 60 digits to begin with, if not those of the hull.
    """
    if start is None:
        start = exact(hull.vertices)
    return Motion(
        facet_polygons(hull),
        hull.triangles,
        lambda time: start + time * exact(along),
        None if center is None else lambda time: exact(center) + time * exact(center_along),
    )


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
    units = units / norms(units)[:, None]
    polygons = facet_polygons(hull)
    planes = np.argmax(hull.normals @ units.T, axis=1)
    # Of the planes that meet in a corner the three that are least in line.
    meeting = [
        max(
            combinations([planes[f] for f, one in enumerate(polygons) if corner in one], 3),
            key=lambda three: abs(np.linalg.det(units[list(three)])),
        )
        for corner in range(len(hull.vertices))
    ]

    def corners(time: Number) -> Numbers:
        moved = exact(parameters) + time * exact(along)
        normals = [unit(normal) for normal in moved[: 3 * count].reshape(count, 3)]
        heights = [mpmath.exp(logarithm) for logarithm in moved[3 * count :]]
        motions = []
        for i, j, k in meeting:
            # By Cramer's rule.
            a, b, c = normals[i], normals[j], normals[k]
            bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
            motions.append((heights[i] * bc + heights[j] * ca + heights[k] * ab) / (a @ bc))
        return exact(origin) + np.array(motions)

    still = None if center is None else lambda time: exact(center)
    return Motion(polygons, hull.triangles, corners, still)


def _triangles(corners: Numbers, polygon: Sequence[int]) -> list[Sequence[int]]:
    """Triangles of the upper side of the convex hull of a nearly flat polygon."""
    if len(polygon) < 4:
        return [polygon] if len(polygon) == 3 else []
    first, last, best = polygon[0], polygon[-1], 1
    for place in range(2, len(polygon) - 1):
        normal = cross(corners[polygon[best]] - corners[first], corners[last] - corners[first])
        if normal @ (corners[polygon[place]] - corners[first]) > 0:
            best = place
    return [
        (first, polygon[best], last),
        *_triangles(corners, polygon[: best + 1]),
        *_triangles(corners, polygon[best:]),
    ]


MOVE = "1e-25"
"""Relative size of the changes: small enough to change no decision, and with enough digits left."""

TRIALS = 3


def probability_condition(hull: ConvexHull, center: Floats) -> float:
    """Largest change of a probability over the relative change of coordinates, estimated from
    below.

    Every corner is moved by a part of its distance from the center of mass (3,), in random
    directions along the axes. 0 if the oracle has no answer.
    """
    polygons = facet_polygons(hull)
    with mpmath.workdps(DIGITS):
        try:
            before, *others = (
                np.array(oracle_probabilities(corners, polygons, [center]))
                for corners in _moved(hull, center)
            )
        except OracleError:
            return 0.0
        return float(abs(np.array(others) - before).max() / mpmath.mpf(MOVE))


def derivative_condition(
    hull: ConvexHull, center: Floats | None, along: Floats, center_along: Floats
) -> float:
    """Relative change of the largest derivative of a probability over the relative change of
    coordinates, estimated as by `probability_condition`. Arguments and errors are those of
    `oracle_derivative`.
    """
    middle = hull.centroid if center is None else center
    with mpmath.workdps(DIGITS):
        before, *others = (
            derivative(corner_motion(hull, center, along, center_along, corners))
            for corners in _moved(hull, middle)
        )
        change = abs(np.array(others) - before).max()
        return float(change / mpmath.mpf(MOVE) / abs(before).max())


def _moved(hull: ConvexHull, center: Floats) -> Iterator[Numbers]:
    """Yield the corners of a hull, then copies in which each corner is moved by a part of its
    distance from a center (3,), in random directions along the axes."""
    rng = np.random.default_rng(0)
    reaches = norms(hull.vertices - center)[:, None]
    for step in (0, *[mpmath.mpf(MOVE)] * TRIALS):
        moves = reaches * rng.choice([-1.0, 1.0], size=hull.vertices.shape)
        yield exact(hull.vertices) + step * exact(moves)
