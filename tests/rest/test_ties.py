"""Decisions that rounding could change: exact arithmetic, and the rule for bodies that balance."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.rest import equilibria as equilibria_module
from dicedesign.rest import tracing as tracing_module
from dicedesign.rest.equilibria import classify
from dicedesign.rest.exact import ExactSigns
from dicedesign.rest.morse import separatrices
from dicedesign.rest.poses import TIED, RestPoses, rest_poses
from dicedesign.rest.probabilities import TIE_DIRECTION

HALVES = [
    [[3, 1, 3], [3, -2, -3], [2, 2, 0], [1, 2, 2], [1, -2, -1], [0, 3, 1]],
    [[1, 0, 1], [0, 2, 2], [0, 0, -2], [-1, -2, 0], [-1, -1, 0], [1, -2, 0], [1, 1, -1]],
]
"""Corners of centrally symmetric bodies; the others are their opposites."""

BALANCED = [
    [[-1, -1, -1], [0, 0, 0], [0, 1, 0], [1, 0, 0]],
    [[-2, 0, -1], [-2, 1, -2], [-2, 1, -1], [2, -1, 1]],
    [[-1, 0, 0], [0, 0, -1], [0, 1, -1], [1, -1, -1]],
    [[-1, 0, 1], [0, 1, 0], [1, -1, 1], [1, 1, -1]],
]


def by_normal(poses: RestPoses) -> dict[tuple[float, ...], float]:
    return {
        tuple(np.round(normal, 6) + 0.0): float(p)
        for normal, p in zip(poses.normals, poses.probabilities, strict=True)
    }


def fractions(vector: np.ndarray) -> list[Fraction]:
    return [Fraction(float(x)) for x in vector]


def dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def minus(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [x - y for x, y in zip(a, b, strict=True)]


def rational_signs(hull: ConvexHull, center: np.ndarray, half_edge: int) -> tuple[int, int]:
    """Growth and side of a half-edge of a triangular facet, in rational arithmetic."""
    p, q = hull.tail[half_edge], hull.head[half_edge]
    third = hull.head[hull.next[half_edge]]
    c, x, y, z = (fractions(v) for v in (center, *hull.vertices[[p, q, third]]))
    r, v = minus(x, c), minus(y, x)
    normal = cross(v, minus(z, x))
    values = dot(r, v), dot(r, cross(v, normal))
    return tuple(1 if value > 0 else -1 for value in values)


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9, 1e-200])
def test_exact_signs_are_those_of_rational_arithmetic(scale: float) -> None:
    rng = np.random.default_rng(1)
    hull = convex_hull(scale * rng.normal(size=(12, 3)))
    for shift in (0.0, 1e-3, 1e-16):
        center = hull.centroid * (1.0 + shift)
        exact = ExactSigns(hull, center)
        for half_edge in range(len(hull.tail)):
            found = exact.growth(half_edge), exact.side(half_edge)
            assert found == rational_signs(hull, center, half_edge)


def test_signs_within_rounding_are_asked_for() -> None:
    """Feet of the center on an edge's ends to the last bit: floats cannot tell, fractions can."""
    rng = np.random.default_rng(2)
    asked = 0
    for _ in range(40):
        corners = rng.normal(size=(8, 3))
        hull = convex_hull(corners)
        # A center in the plane through a corner that is normal to one of its edges, rounded.
        v = hull.vertices[hull.head[0]] - hull.vertices[hull.tail[0]]
        foot = hull.vertices[hull.tail[0]] - hull.centroid
        center = hull.centroid + v * (foot @ v) / (v @ v)
        equilibria = classify(hull, hull.centroid)
        if ((hull.vertices[hull.tail] - center) * hull.normals[hull.facet]).sum(-1).min() <= 0.01:
            continue
        equilibria = classify(hull, center)
        asked += 1
        for half_edge in range(len(hull.tail)):
            expected = rational_signs(hull, center, half_edge)
            found = equilibria.growth_sign[half_edge], equilibria.side_sign[half_edge]
            assert tuple(found) == expected
    assert asked > 5


def test_exact_lines_are_those_of_the_floats(monkeypatch: pytest.MonkeyPatch) -> None:
    """With error bounds blown up, every decision is taken in exact arithmetic."""
    hulls = [convex_hull(np.random.default_rng(seed).normal(size=(16, 3))) for seed in range(20)]
    plain = [separatrices(classify(hull, hull.centroid)) for hull in hulls]
    monkeypatch.setattr(equilibria_module, "ROUNDING", 1e6)
    monkeypatch.setattr(tracing_module, "ROUNDING", 1e6)
    crossings = 0
    for hull, paths in zip(hulls, plain, strict=True):
        exact = separatrices(classify(hull, hull.centroid))
        np.testing.assert_array_equal(exact.basins, paths.basins)
        np.testing.assert_array_equal(exact.maxima, paths.maxima)
        np.testing.assert_array_equal(exact.lengths, paths.lengths)
        for branch, length in enumerate(paths.lengths):
            np.testing.assert_array_equal(
                exact.crossed[branch, :length], paths.crossed[branch, :length]
            )
            crossings += length
    assert crossings > 50


@pytest.mark.parametrize("points", BALANCED)
def test_a_balanced_body_is_the_mean_of_its_neighbours(points: list[list[int]]) -> None:
    poses = rest_poses(points)
    assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    sides = [
        by_normal(rest_poses(points, poses.center_of_mass + sign * 1e-9 * TIE_DIRECTION))
        for sign in (1.0, -1.0)
    ]
    for normal, p in by_normal(poses).items():
        assert p == pytest.approx(sum(side.get(normal, 0.0) for side in sides) / 2.0, abs=1e-3)


def test_a_tie_that_matters_is_told() -> None:
    notes = [TIED in rest_poses(points).notes for points in BALANCED]
    assert any(notes)
    half = np.array(HALVES[0])
    assert TIED in rest_poses(np.concatenate([half, -half])).notes


@pytest.mark.parametrize("half", HALVES)
def test_what_could_fall_both_ways_falls_both_ways_equally_often(half: list[list[int]]) -> None:
    """Every direction and its opposite fare alike on a centrally symmetric body."""
    odds = by_normal(rest_poses(np.concatenate([half, -np.array(half)])))
    for normal, p in odds.items():
        opposite = tuple(-x + 0.0 for x in normal)
        assert odds[opposite] == pytest.approx(p, abs=1e-5)


def test_bodies_in_general_position_are_not_tied() -> None:
    for seed in range(50):
        points = np.random.default_rng(seed).normal(size=(4 + seed, 3))
        assert TIED not in rest_poses(points).notes
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    assert TIED not in rest_poses(cube).notes


def test_small_integer_bodies_never_fail() -> None:
    """Some of them balance somewhere."""
    rng = np.random.default_rng(4)
    tied = 0
    for _ in range(300):
        points = rng.integers(-2, 3, size=(rng.integers(5, 10), 3))
        if np.linalg.matrix_rank(points - points[0]) < 3:
            continue
        poses = rest_poses(points)
        assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
        tied += TIED in poses.notes
    assert tied > 5
