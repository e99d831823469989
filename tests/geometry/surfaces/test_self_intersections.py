"""Self-intersections against an exact clipping of triangles, and on surfaces known to have them."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
import trimesh
from common.exact_vectors import Vector, cross, dot, minus
from scipy.spatial.transform import Rotation

from dicedesign.geometry.surfaces.self_intersections import (
    intersecting_triangles,
    overlapping_boxes,
)


def clipped(polygon: list[Vector], origin: Vector, normal: Vector) -> list[Vector]:
    """The part of a convex polygon, a segment or a point on the side that the normal points to."""
    heights = [dot(minus(corner, origin), normal) for corner in polygon]
    part = []
    for k, (p, h) in enumerate(zip(polygon, heights, strict=True)):
        q, other = polygon[k - 1], heights[k - 1]
        if h * other < 0:
            share = h / (h - other)
            part.append(tuple(x + share * step for x, step in zip(p, minus(q, p), strict=True)))
        if h >= 0:
            part.append(p)
    return part


def common_corners(one: list[Vector], other: list[Vector]) -> set[Vector]:
    """The corners of what two triangles have in common."""
    normal = cross(minus(one[1], one[0]), minus(one[2], one[0]))
    part = clipped(clipped(other, one[0], normal), one[0], tuple(-x for x in normal))
    for k in range(3):
        edge = minus(one[k], one[k - 1])
        part = clipped(part, one[k], cross(normal, edge)) if part else []
    return set(part)


def exactly_intersecting(points: np.ndarray, triangles: np.ndarray) -> list[tuple[int, int]]:
    """As `intersecting_triangles`, with folds only where they are exactly flat."""
    corners = [[tuple(Fraction(float(x)) for x in points[i]) for i in t] for t in triangles]
    has_area = [any(cross(minus(b, a), minus(c, a))) for a, b, c in corners]
    found = []
    for i, j in combinations(range(len(triangles)), 2):
        if not (has_area[i] and has_area[j]):
            continue
        shared = [corners[i][k] for k in range(3) if triangles[i][k] in triangles[j]]
        beyond = common_corners(corners[i], corners[j]) - set(shared)
        if len(shared) == 2:  # the rest of the edge is shared as well
            direction = minus(shared[1], shared[0])
            beyond = {p for p in beyond if any(cross(direction, minus(p, shared[0])))}
        if beyond or len(shared) == 3:
            found.append((i, j))
    return found


def pairs_of(points: np.ndarray, triangles: np.ndarray) -> list[tuple[int, int]]:
    return [(int(i), int(j)) for i, j in intersecting_triangles(points, triangles)]


def soup(rng: np.random.Generator, points: int, triangles: int) -> np.ndarray:
    return np.array([rng.choice(points, 3, replace=False) for _ in range(triangles)])


@pytest.mark.parametrize("seed", range(12))
def test_soups_of_few_places_agree_with_exact_clipping(seed: int) -> None:
    """Small integers give every kind of contact: coplanar, collinear, touching, without area."""
    rng = np.random.default_rng(seed)
    size = (2, 3, 3, 4, 5, 6)[seed % 6]
    places = np.unique(rng.integers(0, size, (16, 3)), axis=0).astype(np.float64)
    if seed % 2:
        places[:, 2] *= rng.integers(0, 2)  # some lie in one plane
        places = np.unique(places, axis=0)
    triangles = soup(rng, len(places), 40)
    expected = exactly_intersecting(places, triangles)
    assert pairs_of(places, triangles) == expected
    assert len(expected) > 20


@pytest.mark.parametrize("seed", range(4))
def test_places_off_by_one_unit_of_rounding_agree_with_exact_clipping(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    places = np.unique(rng.integers(0, 4, (14, 3)), axis=0) / 3.0 + 7.0
    places = np.nextafter(places, places + rng.integers(-1, 2, places.shape))
    triangles = soup(rng, len(places), 40)
    # Folds of nearly no angle count within a tolerance: only others are compared.
    edges = {
        (i, j)
        for i, j in combinations(range(len(triangles)), 2)
        if len(np.intersect1d(triangles[i], triangles[j])) == 2
    }
    expected = set(exactly_intersecting(places, triangles)) - edges
    assert set(pairs_of(places, triangles)) - edges == expected


@pytest.mark.parametrize("seed", range(3))
def test_random_soups_agree_with_exact_clipping(seed: int) -> None:
    rng = np.random.default_rng(200 + seed)
    points = rng.normal(size=(60, 3))
    triangles = soup(rng, 60, 60)
    assert pairs_of(points, triangles) == exactly_intersecting(points, triangles)


def test_boxes_agree_with_all_pairs() -> None:
    rng = np.random.default_rng(5)
    for count in (1, 2, 3, 50, 64, 65):
        lower = rng.integers(0, 12, (count, 3)).astype(np.float64)
        upper = lower + rng.integers(0, 3, (count, 3)) * rng.integers(0, 4, (count, 1))
        meet = (lower[:, None] <= upper[None]).all(-1) & (lower[None] <= upper[:, None]).all(-1)
        np.testing.assert_array_equal(
            overlapping_boxes(lower, upper), np.argwhere(np.triu(meet, 1))
        )


def sphere(radius: float = 1.0, shift: tuple[float, float, float] = (0, 0, 0)) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=3, radius=radius).apply_translation(shift)


def joined(*parts: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.util.concatenate(list(parts))
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)


def test_two_spheres_cross_on_their_circle_only() -> None:
    points, triangles = joined(sphere(), sphere(shift=(0.8, 0.1, 0.05)))
    pairs = intersecting_triangles(points, triangles)
    assert len(pairs) > 100
    assert ((pairs[:, 0] < 1280) & (pairs[:, 1] >= 1280)).all()
    distances = np.linalg.norm(points[triangles[pairs[:, 0]]].mean(axis=1), axis=1)
    other = np.linalg.norm(points[triangles[pairs[:, 0]]].mean(axis=1) - [0.8, 0.1, 0.05], axis=1)
    np.testing.assert_allclose(distances, other, rtol=0, atol=0.25)


def test_spheres_inside_or_beside_each_other_do_not_meet() -> None:
    for other in (sphere(0.5), sphere(shift=(2.5, 0, 0))):
        assert len(intersecting_triangles(*joined(sphere(), other))) == 0


@pytest.mark.parametrize("turn", range(4))
def test_the_answer_does_not_depend_on_the_frame(turn: int) -> None:
    points, triangles = joined(sphere(), sphere(shift=(0.8, 0.1, 0.05)))
    expected = intersecting_triangles(points, triangles)
    rotation = Rotation.random(random_state=turn).as_matrix()
    moved = 10.0 ** (turn * 10 - 15) * (points @ rotation.T + [3.0, -1.0, 2.0])
    np.testing.assert_array_equal(intersecting_triangles(moved, triangles), expected)


def test_a_tube_through_its_own_wall_is_found() -> None:
    """An immersed Klein bottle: a figure of eight turned half around a circle."""
    around, across = 60, 40
    u, v = np.meshgrid(
        2 * np.pi * np.arange(around) / around,
        2 * np.pi * (np.arange(across) + 0.37) / across,
        indexing="ij",
    )
    radius = 2 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    height = np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)
    points = np.stack((radius * np.cos(u), radius * np.sin(u), height), axis=-1).reshape(-1, 3)
    i, j = np.arange(around - 1)[:, None], np.arange(across)[None]
    a, b = i * across + j, i * across + (j + 1) % across
    c, d = a + across, b + across
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])
    pairs = intersecting_triangles(points, triangles)
    assert len(pairs) > around
    middles = points[triangles[np.unique(pairs)]].mean(axis=1)
    np.testing.assert_allclose(np.hypot(middles[:, 0], middles[:, 1]), 2.0, atol=0.3)
    np.testing.assert_allclose(middles[:, 2], 0.0, atol=0.3)


@pytest.mark.parametrize("turned", [False, True])
def test_triangles_side_by_side_in_a_plane_do_not_intersect(turned: bool) -> None:
    rng = np.random.default_rng(3)
    flat = trimesh.creation.box((1.0, 2.0, 3.0)).subdivide().subdivide().subdivide()
    points, triangles = np.asarray(flat.vertices).copy(), np.asarray(flat.faces, dtype=np.int64)
    inside = (np.isclose(np.abs(points), [0.5, 1.0, 1.5]).sum(axis=1) == 1)[:, None]
    free = ~np.isclose(np.abs(points), [0.5, 1.0, 1.5])
    points += 0.02 * inside * free * rng.uniform(-1, 1, points.shape)
    if turned:
        points = points @ Rotation.random(random_state=1).as_matrix().T
    assert len(triangles) == 768
    assert len(intersecting_triangles(points, triangles)) == 0


@pytest.mark.parametrize("seed", range(6))
def test_caps_pressed_onto_planes_do_not_intersect(seed: int) -> None:
    """As hull fills leave them: triangles that lie in a plane to within rounding."""
    rng = np.random.default_rng(seed)
    ball = sphere()
    points = np.asarray(ball.vertices) + 0.01 * rng.normal(size=(642, 3))
    for normal in Rotation.random(random_state=seed).as_matrix():
        beyond = np.maximum(points @ normal - 0.8, 0.0)
        points = points - beyond[:, None] * normal
    assert len(intersecting_triangles(points, np.asarray(ball.faces))) == 0


def test_a_mushroom_pressed_onto_a_plane_intersects() -> None:
    ball = sphere()
    points = np.asarray(ball.vertices)
    points = points * (1.0 + np.array([[0.8, 0.8, 0.0]]) * (points[:, 2:] > 0.5))
    assert len(intersecting_triangles(points, np.asarray(ball.faces))) == 0
    turn = Rotation.random(random_state=1).as_matrix()
    pressed = np.column_stack((points[:, :2], np.minimum(points[:, 2], 0.4))) @ turn.T
    assert len(intersecting_triangles(pressed, np.asarray(ball.faces))) > 20


def test_a_vertex_pulled_across_its_neighbors_in_the_plane_overlaps() -> None:
    angles = 2 * np.pi * np.arange(6) / 6
    ring = np.column_stack((np.cos(angles), np.sin(angles), np.zeros(6)))
    triangles = np.array([(6, k, (k + 1) % 6) for k in range(6)])
    for turn in (np.eye(3), Rotation.random(random_state=2).as_matrix()):
        inside = np.vstack((ring, [0.3, 0.2, 0.0])) @ turn.T
        assert len(intersecting_triangles(inside, triangles)) == 0
        outside = np.vstack((ring, [1.5, 0.7, 0.0])) @ turn.T
        assert len(intersecting_triangles(outside, triangles)) > 0


def test_folds_count_when_they_are_flat() -> None:
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    for angle, meets in ((0.0, True), (1e-8, True), (1e-4, False), (np.pi, False)):
        points = np.array(
            [[0, 0, 0], [1, 0, 0], [0.4, 1, 0], [0.6, 0.5 * np.cos(angle), 0.5 * np.sin(angle)]]
        )
        turned = points @ Rotation.random(random_state=4).as_matrix().T
        assert (len(intersecting_triangles(turned, triangles)) == 1) is meets


def test_a_flattened_fin_is_folded_flat() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.0]])
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    assert pairs_of(points, tetrahedron) == [(0, 1), (0, 2), (0, 3)]
    points[3, 2] = 0.1
    assert pairs_of(points, tetrahedron) == []


def test_the_same_triangle_twice_intersects() -> None:
    points = np.eye(3)
    assert pairs_of(points, np.array([[0, 1, 2], [2, 1, 0], [1, 2, 0]])) == [(0, 1), (0, 2), (1, 2)]


def test_triangles_without_area_are_left_out() -> None:
    points = np.array([[0, 0, 0], [2, 0, 0], [1, 0, 0], [0.5, -1, -1], [0.5, 1, -1], [0.5, 0, 1]])
    assert pairs_of(points, np.array([[0, 1, 2], [3, 4, 5]])) == []
