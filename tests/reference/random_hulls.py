"""Random hulls of several kinds, determined by their numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.rest.equilibria import classify
from dicedesign.runtime.arrays import Floats
from tests.reference.problem import Problem

POINTS = (4, 20)
"""Least and largest number of points of a hull."""

SEED = 20
"""Random seed."""


def random_hull(number: int) -> tuple[str, Problem]:
    """Kind of hull, and a body of triangles with at least two rests.

    Kinds alternate. Of each kind, every other body is uniform, the others have a center of mass
    near the centroid.
    """
    rng = np.random.default_rng([SEED, number])
    kind = tuple(KINDS)[number % len(KINDS)]
    uniform = (number // len(KINDS)) % 2 == 0
    while True:
        points = KINDS[kind](rng)
        hull = convex_hull(points)
        inside = rng.dirichlet(np.ones(len(points))) @ points
        center = hull.centroid if uniform else 0.5 * hull.centroid + 0.5 * inside
        triangular = len(hull.triangles) == len(hull.normals)
        if triangular and np.count_nonzero(classify(hull, center).stable) > 1:
            return kind, Problem(hull.vertices, None if uniform else center)


def off_center_body(seed: int) -> tuple[Floats, Floats]:
    """4 to 30 points (n, 3) and a center of mass (3,) inside, away from the centroid."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4 + seed % 27, 3)) * rng.uniform(0.5, 1.5, size=3)
    hull = convex_hull(points)
    somewhere = rng.dirichlet(np.ones(len(hull.vertices))) @ hull.vertices
    return points, 0.6 * hull.centroid + 0.4 * somewhere


def extreme_hulls(
    count: int, most: int = 16, tolerance: float | None = None
) -> Iterator[ConvexHull]:
    """Yield hulls of round bodies, flat ones, needles, spheres and small lattices in turn; fewer
    where points span no solid. most: largest number of points; tolerance: coplanar tolerance."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        points = rng.normal(size=(int(rng.integers(5, most + 1)), 3))
        match seed % 5:
            case 1:
                points *= [1.0, 1.0, 10.0 ** rng.uniform(-6, 0)]
            case 2:
                points *= [1.0, 1.0, 10.0 ** rng.uniform(0, 6)]
            case 3:
                points = unit_vectors(points)
            case 4:
                points = rng.integers(-3, 4, size=points.shape).astype(np.float64)
        with suppress(DiceError):
            yield convex_hull(points, tolerance)


def _cloud(rng: np.random.Generator) -> Floats:
    return rng.normal(size=(_count(rng), 3))


def _ellipsoid(rng: np.random.Generator) -> Floats:
    directions = rng.normal(size=(_count(rng), 3))
    return unit_vectors(directions) * rng.uniform(0.4, 1.0, size=3)


def _needle(rng: np.random.Generator) -> Floats:
    """Points of a needle, 3 to 300 times as long as wide."""
    return _cloud(rng) * np.array([1.0, 1.0, 10.0 ** rng.uniform(0.5, 2.5)])


def _prism(rng: np.random.Generator) -> Floats:
    """Corners of a regular prism, with errors from a tenth to a ten-thousandth of its radius."""
    sides = int(rng.integers(3, POINTS[1] // 2 + 1))
    angles = 2.0 * np.pi * np.arange(sides) / sides
    height = rng.uniform(0.3, 1.5)
    points = np.concatenate(
        [np.column_stack([np.cos(angles), np.sin(angles), np.full(sides, z)]) for z in (0, height)]
    )
    return points + 10.0 ** rng.uniform(-4.0, -1.0) * rng.uniform(-1.0, 1.0, size=points.shape)


def _count(rng: np.random.Generator) -> int:
    return int(rng.integers(POINTS[0], POINTS[1] + 1))


KINDS = {
    "normal cloud": _cloud,
    "ellipsoid": _ellipsoid,
    "needle": _needle,
    "perturbed prism": _prism,
}
