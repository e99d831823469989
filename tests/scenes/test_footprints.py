"""Convex polygons: hull, area and the widest strip, against Qhull and clipping."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from dicedesign.scenes.footprints import Footprint, gap


def meet(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two convex hulls of points have one in common, by a linear program."""
    n, m = len(one), len(other)
    rows = np.vstack([np.hstack([one.T, -other.T]), np.r_[np.ones(n), np.zeros(m)]])
    rows = np.vstack([rows, np.r_[np.zeros(n), np.ones(m)]])
    return bool(linprog(np.zeros(n + m), A_eq=rows, b_eq=[0.0, 0.0, 1.0, 1.0]).status == 0)


@pytest.mark.parametrize("seed", range(6))
def test_hull_and_area_are_those_of_qhull(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(40, 2)) + 7.0
    polygon = Footprint.under(points)
    expected = ConvexHull(points)
    np.testing.assert_array_equal(
        np.unique(polygon.corners, axis=0), np.unique(points[expected.vertices], axis=0)
    )
    assert polygon.area == pytest.approx(expected.volume, rel=1e-12)


def test_repeated_points_and_points_on_edges_are_no_corners() -> None:
    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
    polygon = Footprint.under(np.concatenate([grid, grid, grid[:1] + 1e-17]))
    assert sorted(map(tuple, polygon.corners.tolist())) == [(0, 0), (0, 2), (3, 0), (3, 2)]
    assert polygon.area == 6.0
    assert polygon.room_around(np.array([1.0, 1.0])) == pytest.approx(1.0)
    assert polygon.room_around(np.array([5.0, 1.0])) == 0.0


@pytest.mark.parametrize("seed", range(40))
def test_a_strip_is_there_where_two_have_no_point_in_common(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, other = (rng.normal(size=(8, 2)) * [1.5, 0.4] for _ in range(2))
    shift = rng.normal(size=2) * 1.5
    found = gap(Footprint.under(one), Footprint.under(other), shift)
    assert (found <= 0.0) == meet(one, other + shift)
    # As wide as it is, the second may be pushed by nearly that without meeting the first.
    if found > 0.0:
        for angle in np.linspace(0.0, 2.0 * np.pi, 9):
            push = 0.999 * found * np.array([np.cos(angle), np.sin(angle)])
            assert not meet(one, other + shift + push)
