"""Corners that stand for a hull, and how far a surface is displaced by them, by other code."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from common.bumpy import ball, bumpy_sphere, unit
from scipy.spatial import ConvexHull as OtherHull
from scipy.spatial.distance import cdist

from dicedesign.concave.hull_problem import (
    CLOSE,
    FREE,
    MOST_CORNERS,
    SPREAD,
    HullMetric,
    HullProblem,
    coarse_corners,
)
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import best_similarity
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats


def heights_above(points: Floats, corners: Floats) -> Floats:
    """(n,) of points over the hull of others; negative inside."""
    equations = OtherHull(corners).equations
    return np.asarray((points @ equations[:, :3].T + equations[:, 3]).max(axis=1))


def squashed(subdivisions: int) -> Surface:
    """A round body, all of whose points are corners, of three widths."""
    surface = ball(subdivisions)
    return unit(surface.with_points(surface.points * np.array([1.0, 0.8, 0.3])))


@pytest.mark.parametrize("surface", [unit(bumpy_sphere(3)), squashed(3)])
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


@pytest.mark.parametrize("coarse", [True, False])
def test_a_problem_tells_which_points_its_corners_are(coarse: bool) -> None:
    surface = unit(bumpy_sphere(3))
    problem = HullProblem(surface, np.array([0.5, 0.5]), 0.004, coarse=coarse)
    np.testing.assert_array_equal(surface.points[problem.source], problem.hull.vertices)
    whole = OtherHull(surface.points).vertices
    assert np.isin(problem.source, whole).all()
    assert (len(problem.source) < len(whole)) == coarse


SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])


@cache
def problem() -> HullProblem:
    surface = bumpy_sphere()
    return HullProblem(
        unit(surface.with_points(surface.points @ SHEAR)), np.array([0.5, 0.5]), 0.004
    )


@cache
def led() -> tuple[Floats, Floats]:
    """(3 n, 3 n) displacements of all points for forces on them, and (3 c, 3 n) those of the
    corners relative to the center of mass, by differences."""
    surface, source, step = problem().surface, problem().source, 1e-5
    points = surface.points
    rows = np.zeros((len(source), 3, *points.shape))
    rows[np.arange(len(source))[:, None], np.arange(3), source[:, None], np.arange(3)] = 1.0
    for point in range(len(points)):
        for axis in range(3):
            shift = np.zeros_like(points)
            shift[point, axis] = step
            ahead = surface.with_points(points + shift).centroid
            behind = surface.with_points(points - shift).centroid
            rows[:, :, point, axis] -= (ahead - behind) / (2.0 * step)
    responses = np.kron(FREE - cdist(points, points), np.eye(3))
    return responses, rows.reshape(3 * len(source), -1)


def displacement_of_all(moved: Floats) -> Floats:
    """(n, 3) the one of least work for a displacement (c, 3) of the corners."""
    responses, rows = led()
    forces = np.linalg.solve(rows @ responses @ rows.T, moved.ravel())
    return (responses @ rows.T @ forces).reshape(-1, 3)


def square(moved: Floats) -> float:
    """What the quadratic form says."""
    return float(np.tensordot(np.tensordot(problem().displacement_form, moved, 2), moved, 2))


@pytest.mark.parametrize("smooth", [True, False])
def test_it_is_what_a_similarity_leaves(smooth: bool) -> None:
    points, random = problem().surface.points, np.random.default_rng(0)
    corners = points[problem().source]
    moved = random.normal(size=corners.shape)
    if smooth:
        moved = np.sin(corners @ random.normal(size=(3, 3)) * 2.0)
    # As small as derivatives are exact for.
    there = points + 1e-5 * displacement_of_all(moved)
    back = best_similarity(there, points, np.ones(len(points)))
    squares = ((back(there) - points) ** 2).sum(axis=1)
    assert square(moved) == pytest.approx(1e10 * squares.mean(), rel=1e-3)
    whole = np.sqrt(1e10 * squares.mean()) / problem().surface.diagonal
    assert problem().displacement(moved) == pytest.approx(whole, rel=1e-3)


def test_the_metric_is_smoothness_and_work_and_displacement() -> None:
    metric_problem = problem()
    hull, count = metric_problem.hull, len(metric_problem.hull.vertices)
    u = np.random.default_rng(5).normal(size=(count, 3))
    rough = np.zeros_like(u)
    for tail, head in zip(hull.tail.tolist(), hull.head.tolist(), strict=True):
        rough[tail] += u[tail] - u[head]
    costs = []
    for elastic, displaced in ((0.0, 0.0), (3.0, 0.0), (0.0, 3.0)):
        metric = HullMetric(0.5, 2.0, elastic, displaced)
        flat = metric_problem.compliance(metric).reshape(3 * count, 3 * count)
        costs.append(float(u.ravel() @ np.linalg.solve(flat, u.ravel())))
    assert costs[0] == pytest.approx(((0.5 * u + 2.0 * rough) ** 2).sum() / count, rel=1e-7)
    work = np.tensordot(np.tensordot(u, metric_problem.held.relative[0], 2), u, 2)
    assert costs[1] - costs[0] == pytest.approx(3.0 * float(work), rel=1e-4)
    square = (metric_problem.displacement(u) * metric_problem.surface.diagonal) ** 2
    assert costs[2] - costs[0] == pytest.approx(3.0 * square, rel=1e-4)
