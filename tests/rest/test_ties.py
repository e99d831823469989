"""Decisions that rounding could change: exact arithmetic, and the rule for bodies that balance."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from common.kernels import without_kernels
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.rest import equilibria as equilibria_module
from dicedesign.rest import tracing as tracing_module
from dicedesign.rest.basins import MOST_FLAGS, aside_directions
from dicedesign.rest.equilibria import ExactSigns, classify
from dicedesign.rest.morse import separatrices
from dicedesign.rest.poses import TIED, RestPoses, rest_poses

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


@without_kernels()
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
    moves = 1e-9 * aside_directions(poses.hull, poses.center_of_mass)
    sides = [by_normal(rest_poses(points, poses.center_of_mass + move)) for move in moves]
    for normal, p in by_normal(poses).items():
        mean = sum(side.get(normal, 0.0) for side in sides) / len(sides)
        assert p == pytest.approx(mean, abs=1e-3)


QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""A quarter of a turn about z."""

CORNERED = (
    ([(4, 0, 0), (4, 3, 1), (4, 0, 2)], 4),
    ([(4, 0, 0), (4, 3, 1), (4, -1, 3)], 6),
    ([(4, 0, 0), (4, 3, 2), (4, -3, 2)], 6),
)
"""A quarter of the corners of bodies that balance on corners of their facets, which a quarter of a
turn maps to themselves, and the height of two more corners above and below."""


@pytest.mark.parametrize(("quarter", "height"), CORNERED)
def test_a_balance_on_corners_keeps_a_body_s_symmetry(quarter: list, height: float) -> None:
    turns = [np.linalg.matrix_power(QUARTER, k) for k in range(4)]
    points = np.concatenate([quarter @ turn.T for turn in turns])
    points = np.concatenate([points, [(0.0, 0.0, height), (0.0, 0.0, -height)]])
    poses = rest_poses(points, np.zeros(3))
    assert TIED in poses.notes
    for turn in turns:
        image = poses.normals @ turn.T @ poses.normals.T
        nearest = np.argmax(image, axis=1)
        assert image.max(axis=1) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(poses.probabilities[nearest], poses.probabilities, atol=1e-12)


def test_a_balance_is_decided_alike_in_every_orientation() -> None:
    points = np.array(
        [
            *([4, 0, 0], [4, 3, 1], [4, 0, 2], [-3, -1, -3], [-2, 3, -2]),
            *([-3, 0, 4], [0, -4, 0], [1, 1, -4], [0, 4, 1]),
        ],
        dtype=np.float64,
    )
    expected = rest_poses(points, np.zeros(3))
    assert TIED in expected.notes
    for turn in Rotation.create_group("O").as_matrix().round():
        found = rest_poses(points @ turn.T, np.zeros(3))
        np.testing.assert_allclose(found.probabilities, expected.probabilities, atol=1e-12)


def test_the_ways_aside_turn_with_the_body() -> None:
    points = np.random.default_rng(0).normal(size=(9, 3))
    cube = np.array(list(product([-1.0, 1.0], repeat=3)))
    turn = Rotation.random(random_state=1).as_matrix()
    for corners, count in ((points, 2), (cube, 96)):
        hull, turned = convex_hull(corners), convex_hull(corners @ turn.T)
        ways = aside_directions(hull, np.zeros(3)) @ turn.T
        found = aside_directions(turned, np.zeros(3))
        assert len(ways) == len(found) == count <= 2 * MOST_FLAGS
        assert (ways @ found.T).max(axis=1) == pytest.approx(1.0, abs=1e-12)
        assert ways.sum(axis=0) == pytest.approx(0.0, abs=1e-12)


def prism_of(sides: int) -> np.ndarray:
    """Corners (2 sides, 3) of a regular prism, which has 4 sides symmetries."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    up = np.array([0.0, 0.0, 0.7])
    return np.concatenate([ring + up, ring - up])


@pytest.mark.parametrize(("sides", "count"), [(5, 40), (16, 128), (17, 2)])
def test_a_body_is_moved_to_twice_as_many_sides_as_it_has_symmetries(
    sides: int, count: int
) -> None:
    """And to two, where it has more than `MOST_FLAGS`."""
    assert 4 * 16 <= MOST_FLAGS < 4 * 17
    turn = Rotation.from_euler("z", 2.0 * np.pi / sides).as_matrix()
    corners = prism_of(sides)
    for size, shift in ((1.0, 0.0), (1e-3, 5e-3), (1e9, 2e9)):
        center = np.full(3, shift)
        ways = aside_directions(convex_hull(size * corners + center), center)
        assert len(ways) == count
        np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1.0, atol=1e-12)
        np.testing.assert_allclose(ways[::2], -ways[1::2], atol=1e-15)
        if count == 2:
            continue
        # None is on a plane of symmetry, so that no two are the same, and symmetries permute them.
        one = ways[::2]
        assert (one @ one.T - 2.0 * np.eye(len(one))).max() < 1.0 - 1e-4
        for symmetry in (turn, np.diag([1.0, 1.0, -1.0]), np.diag([1.0, -1.0, 1.0])):
            np.testing.assert_allclose((ways @ symmetry.T @ ways.T).max(axis=1), 1.0, atol=1e-9)


@pytest.mark.parametrize("depth", [1.0, 1.05, 1.5, 2.0, 2.5])
def test_a_center_just_inside_has_room(depth: float) -> None:
    """Symmetric centers, which are tied, nearly as deep as what counts as the boundary."""
    for near in (1, 2, 3):
        center = np.zeros(3)
        center[:near] = 1.0 - depth * 1.01e-13
        cube = np.array(list(product([-1.0, 1.0], repeat=3)))
        assert rest_poses(cube, center).probabilities.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_tie_that_matters_is_told() -> None:
    notes = [TIED in rest_poses(points).notes for points in BALANCED]
    assert any(notes)
    half = np.array(HALVES[0])
    assert TIED in rest_poses(np.concatenate([half, -half])).notes


def test_a_tie_that_changes_no_odds_is_not_told() -> None:
    points = np.array(
        [
            [-2, -2, 2],
            [-2, 0, -2],
            [-2, 0, -1],
            [-1, 1, -1],
            [1, 2, 1],
            [2, -2, 0],
            [2, -1, -2],
        ]
    )
    poses = rest_poses(points, np.zeros(3))
    one, other = poses.basins
    np.testing.assert_allclose(one.areas, other.areas, rtol=1e-9)
    assert TIED not in poses.notes


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
