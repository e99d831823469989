"""Corners of a design, elastic space and displacement of a surface, computed in other ways."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from common.bumpy import ball, bumpy_sphere, unit
from scipy.spatial import ConvexHull as OtherHull
from scipy.spatial.distance import cdist, pdist

from dicedesign.concave.hull_problem import (
    CORNERS,
    HANDLES,
    KERNEL_CONSTANT,
    Elasticity,
    HeldCorners,
    HullMetric,
    HullProblem,
)
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import best_similarity
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats


def squashed_ball(subdivisions: int) -> Surface:
    """Ellipsoid, all of whose points are vertices of its hull."""
    surface = ball(subdivisions)
    return unit(surface.with_points(surface.points * np.array([1.0, 0.8, 0.3])))


@pytest.mark.parametrize("surface", [unit(bumpy_sphere(3)), squashed_ball(3)])
def test_corners_of_a_design_are_few_and_spread(surface: Surface) -> None:
    problem = HullProblem(surface, np.array([0.5, 0.5]), 0.004, coarse=True)
    corners, vertices = problem.hull.vertices, OtherHull(surface.points).vertices
    assert len(corners) == CORNERS < len(vertices)
    # No vertex is farther from all corners than they are from each other.
    assert cdist(surface.points[vertices], corners).min(axis=1).max() <= pdist(corners).min()
    np.testing.assert_array_equal(surface.points[problem.source], corners)
    assert np.isin(problem.source, vertices).all()
    fine = HullProblem(surface, np.array([0.5, 0.5]), 0.004)
    np.testing.assert_array_equal(np.sort(fine.source), np.sort(vertices))


SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])


@cache
def problem() -> HullProblem:
    surface = bumpy_sphere()
    return HullProblem(
        unit(surface.with_points(surface.points @ SHEAR)), np.array([0.5, 0.5]), 0.004
    )


@cache
def brute_force() -> tuple[Floats, Floats]:
    """(3 n, 3 n) displacements of all points for forces on them, and (3 c, 3 n) displacements of
    the corners relative to the center of mass, by finite differences."""
    surface, source, step = problem().surface, problem().source, 1e-5
    points = surface.points
    rows = np.zeros((len(source), 3, *points.shape))
    rows[np.arange(len(source))[:, None], np.arange(3), source[:, None], np.arange(3)] = 1.0
    for point, axis in np.ndindex(points.shape):
        shift = np.zeros_like(points)
        shift[point, axis] = step
        ahead = surface.with_points(points + shift).centroid
        behind = surface.with_points(points - shift).centroid
        rows[:, :, point, axis] -= (ahead - behind) / (2.0 * step)
    responses = np.kron(KERNEL_CONSTANT - cdist(points, points), np.eye(3))
    return responses, rows.reshape(3 * len(source), -1)


def forces_by_brute_force(moved: Floats) -> Floats:
    """(3 c,) forces of minimum work for displacements (c, 3) of the corners."""
    responses, rows = brute_force()
    return np.linalg.solve(rows @ responses @ rows.T, moved.ravel())


def displacement_of_all(moved: Floats) -> Floats:
    """(n, 3) displacement of minimum work for displacements (c, 3) of the corners."""
    responses, rows = brute_force()
    return (responses @ rows.T @ forces_by_brute_force(moved)).reshape(-1, 3)


def test_the_displacement_is_measured_after_alignment() -> None:
    points = problem().surface.points
    moved = np.random.default_rng(0).normal(size=problem().hull.vertices.shape)
    # Small enough for the linearization.
    there = points + 1e-5 * displacement_of_all(moved)
    back = best_similarity(there, points, np.ones(len(points)))
    distances = 1e5 * np.linalg.norm(back(there) - points, axis=1) / problem().surface.diagonal
    expected = np.sqrt((distances**2).mean())
    assert problem().displacement(moved) == pytest.approx(expected, rel=1e-3)
    assert problem().mean_displacement(moved) == pytest.approx(distances.mean(), rel=1e-3)


def test_the_metric_sums_smoothness_work_and_displacement() -> None:
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


def test_relative_forces_and_centers_by_brute_force() -> None:
    held, surface = problem().held, problem().surface
    wanted = 0.1 * np.random.default_rng(4).normal(size=(len(held.corners), 3))
    expected = forces_by_brute_force(wanted)
    forces, centers = held.relative
    np.testing.assert_array_equal(forces, forces.transpose(2, 3, 0, 1))
    np.testing.assert_allclose(
        np.tensordot(wanted, forces, 2).ravel(), expected, atol=1e-5 * np.abs(expected).max()
    )
    center = surface.centroid_derivatives().reshape(3, -1) @ displacement_of_all(wanted).ravel()
    np.testing.assert_allclose(np.tensordot(wanted, centers, 2), center, atol=1e-6)


def test_followed_displacements_have_minimum_work() -> None:
    held, points = problem().held, problem().surface.points
    wanted = np.random.default_rng(1).normal(size=(len(held.corners), 3))
    followed = held.follow(wanted)
    np.testing.assert_allclose(followed[held.corners], wanted, atol=1e-10)
    free = np.setdiff1d(np.arange(len(followed)), held.corners)
    forces = np.linalg.inv(KERNEL_CONSTANT - cdist(points, points)) @ followed
    assert np.abs(forces[free]).max() < 1e-8 * np.abs(forces).max()


def test_lumped_and_exact_forces_move_the_center_of_mass_similarly() -> None:
    surface = unit(bumpy_sphere(3))
    assert len(surface.points) > HANDLES
    elasticity = Elasticity(surface)
    gradient = np.moveaxis(surface.centroid_derivatives(), 0, -1)
    exact = np.tensordot(elasticity.responses(np.arange(len(gradient))), gradient, (1, 0))
    lumped = elasticity.center_responses(gradient)
    np.testing.assert_allclose(lumped, exact, atol=2e-3 * np.abs(exact).max())


def test_a_convex_surface_is_refused() -> None:
    convex = unit(ball(1))
    held = HeldCorners(Elasticity(convex), convex_hull(convex.points).source)
    text = "surface: expected one with dents, but 42 of its 42 points are corners of its hull, and"
    with pytest.raises(InputError, match=text):
        _ = held.relative
