"""Corners of intersections of half-spaces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import HalfspaceIntersection

from dicedesign.geometry.hulls.hull import convex_hull, deepest_point, polyhedron_corners

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def volume(corners: np.ndarray) -> float:
    hull = convex_hull(corners)
    return hull.surface.volume


def sorted_rows(points: np.ndarray) -> np.ndarray:
    return points[np.lexsort(np.round(points, 9).T)]


def test_a_box_has_eight_corners() -> None:
    corners = polyhedron_corners(AXES, [1, 2, 3, 4, 5, 6])
    expected = [[x, y, z] for x in (-4, 1) for y in (-5, 2) for z in (-6, 3)]
    np.testing.assert_allclose(sorted_rows(corners), sorted_rows(np.array(expected)), atol=1e-13)


@pytest.mark.parametrize("seed", range(10))
def test_random_corners_satisfy_their_planes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normals = np.concatenate([AXES, rng.normal(size=(20, 3))])
    offsets = rng.uniform(0.5, 2.0, size=len(normals))
    corners = polyhedron_corners(normals, offsets)
    excess = corners @ normals.T - offsets
    assert excess.max() < 1e-13
    assert (np.sum(np.abs(excess) < 1e-12, axis=1) == 3).all()
    other = HalfspaceIntersection(np.column_stack([normals, -offsets]), np.zeros(3)).intersections
    assert volume(corners) == pytest.approx(volume(other), rel=1e-13)
    assert len(corners) == len(convex_hull(other).vertices)


def test_the_deepest_point_of_a_box_and_of_none() -> None:
    normals = np.concatenate([-np.eye(3), np.eye(3)])
    point, depth = deepest_point(normals, np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]))
    assert depth == pytest.approx(0.5)
    assert (normals @ point + 0.5 <= np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]) + 1e-12).all()
    # One below 0 and above 1 at once.
    assert deepest_point(normals, np.array([-2.0, 0.0, 0.0, 1.0, 2.0, 3.0]))[1] <= 0.0
    assert deepest_point(normals[:3], np.zeros(3) + 1.0)[1] == np.inf
