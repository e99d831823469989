"""Self-intersections against an exact clipping of triangles, and on surfaces known to have them."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from dicedesign.geometry.surfaces.self_intersections import (
    intersecting_triangles,
)

Vector = np.ndarray
"""Three fractions."""


def clip(polygon: list[Vector], origin: Vector, normal: Vector) -> list[Vector]:
    """The part of a convex polygon, a segment or a point on the side that the normal points to."""
    heights = [(corner - origin) @ normal for corner in polygon]
    part = []
    for k, (p, h) in enumerate(zip(polygon, heights, strict=True)):
        q, other = polygon[k - 1], heights[k - 1]
        if h * other < 0:
            part.append(p + h / (h - other) * (q - p))
        if h >= 0:
            part.append(p)
    return part


def common_corners(one: list[Vector], other: list[Vector]) -> list[Vector]:
    """Corners of the intersection of two triangles."""
    normal = np.cross(one[1] - one[0], one[2] - one[0])
    part = clip(clip(other, one[0], normal), one[0], -normal)
    for k in range(3):
        part = clip(part, one[k], np.cross(normal, one[k] - one[k - 1])) if part else []
    return part


def exactly_intersecting(points: np.ndarray, triangles: np.ndarray) -> list[tuple[int, int]]:
    """As `intersecting_triangles`, with folds only where they are exactly flat."""
    corners = np.frompyfunc(Fraction, 1, 1)(np.asarray(points, dtype=np.float64))[triangles]
    has_area = [any(np.cross(b - a, c - a)) for a, b, c in corners]
    pairs = []
    for i, j in combinations(range(len(triangles)), 2):
        if not (has_area[i] and has_area[j]):
            continue
        shared = [corners[i][k] for k in range(3) if triangles[i][k] in triangles[j]]
        part = common_corners(corners[i], corners[j])
        beyond = [all(any(p != corner) for corner in shared) for p in part]
        if len(shared) == 2:  # the rest of the edge is shared as well
            beyond = [any(np.cross(shared[1] - shared[0], p - shared[0])) for p in part]
        if any(beyond) or len(shared) == 3:
            pairs.append((i, j))
    return pairs


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


def test_folds_count_when_they_are_flat() -> None:
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    for angle, meets in ((0.0, True), (1e-8, True), (1e-4, False), (np.pi, False)):
        points = np.array(
            [[0, 0, 0], [1, 0, 0], [0.4, 1, 0], [0.6, 0.5 * np.cos(angle), 0.5 * np.sin(angle)]]
        )
        turned = points @ Rotation.random(random_state=4).as_matrix().T
        assert (len(intersecting_triangles(turned, triangles)) == 1) is meets
