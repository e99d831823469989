"""The elastic space about a surface: its kernel, and its inverse."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from common.bumpy import ball, bumpy_sphere, unit

from dicedesign.concave.hull_problem import (
    HANDLES,
    Elasticity,
    HeldCorners,
    point_masses,
    spread_points,
)
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.runtime.arrays import Floats


@cache
def bumpy() -> HeldCorners:
    surface = unit(bumpy_sphere())
    return HeldCorners(Elasticity(surface), convex_hull(surface.points).source)


def kernel(held: HeldCorners) -> Floats:
    """(n, n) that of all points."""
    return held.elasticity.responses(np.arange(len(held.elasticity.surface.points)))


def test_work_is_least_among_displacements_that_move_the_corners_alike() -> None:
    held = bumpy()
    stiffness = np.linalg.inv(kernel(held))
    rng = np.random.default_rng(1)
    wanted = rng.normal(size=(len(held.corners), 3))
    found = held.follow(wanted)
    np.testing.assert_allclose(found[held.corners], wanted, atol=1e-10)
    free = np.setdiff1d(np.arange(len(found)), held.corners)
    forces = stiffness @ found
    assert np.abs(forces[free]).max() < 1e-8 * np.abs(forces).max()


def test_on_a_larger_one_they_are_lumped() -> None:
    surface = unit(bumpy_sphere(3))
    assert len(surface.points) > HANDLES
    elasticity = Elasticity(surface)
    gradient = np.moveaxis(surface.centroid_derivatives(), 0, -1)
    exact = np.tensordot(elasticity.responses(np.arange(len(gradient))), gradient, (1, 0))
    found = elasticity.center_responses(gradient)
    np.testing.assert_allclose(found, exact, atol=2e-3 * np.abs(exact).max())


def test_relative_displacements_by_brute_force() -> None:
    """Least work, over displacements of all points, with wanted places of the corners relative to
    the center of mass, whose motion is linearized: dense, in all coordinates at once."""
    held = bumpy()
    surface = held.elasticity.surface
    size, count = len(surface.points), len(held.corners)
    compliance = np.kron(kernel(held), np.eye(3))
    center = surface.centroid_derivatives().reshape(3, -1)
    rows = np.zeros((3 * count, 3 * size))
    for place, corner in enumerate(held.corners):
        rows[3 * place : 3 * place + 3, 3 * corner : 3 * corner + 3] = np.eye(3)
        rows[3 * place : 3 * place + 3] -= center
    wanted = 0.1 * np.random.default_rng(4).normal(size=(count, 3))
    expected_forces = np.linalg.solve(rows @ compliance @ rows.T, wanted.ravel())
    moved = compliance @ rows.T @ expected_forces
    forces, centers = held.relative
    np.testing.assert_array_equal(forces, forces.transpose(2, 3, 0, 1))
    scale = np.abs(expected_forces).max()
    found = np.tensordot(wanted, forces, 2)
    np.testing.assert_allclose(found.ravel(), expected_forces, atol=1e-5 * scale)
    np.testing.assert_allclose(np.tensordot(wanted, centers, 2), center @ moved, atol=1e-6)


def test_a_convex_surface_has_nothing_to_move_the_center_of_mass_with() -> None:
    convex = unit(ball(1))
    held = HeldCorners(Elasticity(convex), convex_hull(convex.points).source)
    text = "surface: expected one with dents, but 42 of its 42 points are corners of its hull, and"
    with pytest.raises(InputError, match=text):
        _ = held.relative


def test_masses_are_parts_of_the_area() -> None:
    surface = bumpy_sphere(1)
    masses = point_masses(surface)
    a, b, c = surface.points[surface.triangles].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    expected = [areas[(surface.triangles == point).any(axis=1)].sum() / 3.0 for point in range(42)]
    np.testing.assert_allclose(masses, np.array(expected) / areas.sum(), rtol=1e-12)


def test_spread_points_are_each_the_farthest_from_those_before() -> None:
    points = np.random.default_rng(5).normal(size=(40, 3))
    chosen = spread_points(points, 12)
    assert len(set(chosen.tolist())) == 12
    for number in range(1, 12):
        before = points[chosen[:number]]
        nearest = np.linalg.norm(points[:, None] - before, axis=2).min(axis=1)
        assert nearest[chosen[number]] == nearest.max()
    assert sorted(spread_points(points, 100).tolist()) == list(range(40))
