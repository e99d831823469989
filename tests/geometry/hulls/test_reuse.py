"""A hull that keeps its connectivity is the hull that would be built, to the last bit."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
import pytest
from common.kernels import compiled_only
from scipy.spatial.transform import Rotation

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    HullMemory,
    convex_hull,
    polyhedron_corners,
    same_connectivity,
)
from tests.reference.random_hulls import extreme_hulls

pytestmark = compiled_only

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def sphere(seed: int, count: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def ring(sides: int, winding: int = 1) -> np.ndarray:
    angles = 2.0 * np.pi * winding * np.arange(sides) / sides
    return np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)


def prism(sides: int, winding: int = 1) -> np.ndarray:
    return np.concatenate([ring(sides, winding) + np.array([0.0, 0.0, h]) for h in (-0.8, 0.8)])


def bipyramid(sides: int, winding: int = 1) -> np.ndarray:
    return np.concatenate([ring(sides, winding), [[0, 0, -1.0], [0, 0, 1.0]]])


def bodies() -> Iterator[np.ndarray]:
    """Round, thin, symmetric, flat-faceted and short-edged ones, some with points that are no
    vertices."""
    yield from (hull.vertices for hull in extreme_hulls(50, most=40))
    for seed in range(6):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(5, 40))
        points = sphere(seed, count)
        yield polyhedron_corners(np.concatenate([points, CUBE]), np.ones(count + 8))
        yield prism(count)
        yield bipyramid(count)
        yield np.concatenate([points, points + 10.0 ** rng.uniform(-9, -2) * sphere(seed, count)])
        yield np.concatenate([points, 0.7 * points[:3], points[:2]])
        yield CUBE @ Rotation.random(random_state=seed).as_matrix()


def moves(points: np.ndarray, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """All points a little, one point, one into the body, and an affine map."""
    for exponent in range(-16, 0):
        step = 3.0 * 10.0**exponent
        yield points + step * rng.normal(size=points.shape)
        one = points.copy()
        one[rng.integers(len(points))] += step * rng.normal(size=3)
        yield one
        inward = points.copy()
        inward[rng.integers(len(points))] *= 1.0 - step
        yield inward
        yield points @ (np.eye(3) + step * rng.normal(size=(3, 3)))


def rebuild(points: np.ndarray) -> ConvexHull | None:
    try:
        return convex_hull(points)
    except DegenerateBodyError:
        return None


def identical(a: ConvexHull | None, b: ConvexHull | None) -> bool:
    if a is None or b is None:
        return False
    names = ("vertices", "source", "facet_start", "tail", "twin", "triangles", "normals", "head")
    names += ("areas", "centroid", "unevenness", "warp", "facet", "next", "previous")
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


def test_reused_hulls_equal_rebuilt_ones() -> None:
    rng = np.random.default_rng(0)
    tried = reused = 0
    for points in bodies():
        hull = convex_hull(points)
        for moved in moves(points, rng):
            hull_reused = same_connectivity(hull, moved)
            tried += 1
            if hull_reused is not None:
                reused += 1
                assert identical(hull_reused, rebuild(moved))
    assert 0.3 * tried < reused < 0.7 * tried


def test_a_flipped_edge_is_detected() -> None:
    """The fourth point of a bipyramid's equator goes through the diagonal of its neighbors."""
    points = np.array([(1.0, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
    hull = convex_hull(points)
    tilted = points + np.outer([1, -1, 1, -1, 0, 0], [0.0, 0.0, 0.1])
    assert identical(same_connectivity(hull, tilted), convex_hull(tilted))
    inside = points.copy()
    for depth in (0.5, 0.01, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -0.01):
        inside[3, 1] = -depth
        reused = same_connectivity(hull, inside)
        assert (reused is not None) == (depth >= 1e-6)
        assert reused is None or identical(reused, convex_hull(inside))


@pytest.mark.parametrize("shape", [prism, bipyramid])
def test_a_surface_that_winds_around_twice_is_no_hull(shape) -> None:
    """Every edge is convex, and the middle is below every facet."""
    for sides, winding in ((5, 2), (7, 2), (7, 3), (9, 4)):
        for turn in (1, -1):
            hull = convex_hull(shape(sides, turn))
            assert same_connectivity(hull, shape(sides, turn * winding)) is None
            assert same_connectivity(hull, shape(sides, -turn)) is None


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_invalid_hulls_are_refused(bad: float) -> None:
    hull = convex_hull(CUBE)
    broken = CUBE.copy()
    broken[2, 1] = bad
    assert same_connectivity(hull, broken) is None
    assert same_connectivity(hull, CUBE[:7]) is None
    assert same_connectivity(hull, CUBE * [1, 1, 0]) is None
    assert same_connectivity(hull, CUBE + 1e6) is None
    assert same_connectivity(hull, np.concatenate([CUBE, 0.1 * sphere(0, 500)])) is None


def test_a_memory_finds_the_hulls_of_a_walk_and_counts() -> None:
    memory, rng, points = HullMemory(), np.random.default_rng(5), sphere(5, 20)
    for _ in range(60):
        points = points + 3e-3 * rng.normal(size=points.shape)
        assert identical(memory.hull(points), convex_hull(points))
    assert memory.built + memory.reused == 60
    assert memory.reused > 30
    assert memory.built > 1
