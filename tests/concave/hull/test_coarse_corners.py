"""Corners that stand for a hull, against distances by another hull code."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import ball, bumpy_sphere, unit
from scipy.spatial import ConvexHull as OtherHull

from dicedesign.concave.hull_problem import CLOSE, MOST_CORNERS, SPREAD, HullProblem, coarse_corners
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats


def heights_above(points: Floats, corners: Floats) -> Floats:
    """(n,) of points over the hull of others; negative inside."""
    equations = OtherHull(corners).equations
    return np.asarray((points @ equations[:, :3].T + equations[:, 3]).max(axis=1))


def squashed(subdivisions: int) -> Surface:
    """A round body, all of whose points are corners, of three widths."""
    surface = ball(subdivisions)
    return unit(surface.moved(surface.points * np.array([1.0, 0.8, 0.3])))


@pytest.mark.parametrize(
    "surface", [unit(bumpy_sphere(3)), unit(bumpy_sphere(4)), squashed(3), squashed(4)]
)
def test_what_is_left_out_is_near_or_they_are_many(surface: Surface) -> None:
    hull = convex_hull(surface.points)
    chosen = coarse_corners(hull)
    assert (np.diff(chosen) > 0).all()
    assert SPREAD < len(chosen) < len(hull.vertices)
    out = heights_above(hull.vertices, hull.vertices[chosen]).max()
    assert out <= 1.01 * CLOSE or len(chosen) == MOST_CORNERS
    # Far nearer than as many corners at random.
    random = np.random.default_rng(0).choice(len(hull.vertices), len(chosen), replace=False)
    assert out < 0.7 * heights_above(hull.vertices, hull.vertices[random]).max()


def test_all_corners_of_a_small_hull_are_kept() -> None:
    hull = convex_hull(bumpy_sphere(1).points)
    assert len(hull.vertices) <= SPREAD
    np.testing.assert_array_equal(coarse_corners(hull), np.arange(len(hull.vertices)))


@pytest.mark.parametrize("coarse", [True, False])
def test_a_problem_tells_which_points_its_corners_are(coarse: bool) -> None:
    surface = unit(bumpy_sphere(3))
    problem = HullProblem(surface, np.array([0.5, 0.5]), 0.004, coarse=coarse)
    np.testing.assert_array_equal(surface.points[problem.source], problem.hull.vertices)
    whole = OtherHull(surface.points).vertices
    assert np.isin(problem.source, whole).all()
    assert (len(problem.source) < len(whole)) == coarse
