"""Quadratic programs and points inside polyhedra, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.sparse import csc_array

from dicedesign.concave.paper_fill import PointsInside, solve_quadratic_program
from dicedesign.geometry.hulls.hull import convex_hull

pytest.importorskip("clarabel", reason="the optional extra 'concave' is not installed")


def test_a_quadratic_program_against_scipy() -> None:
    rng = np.random.default_rng(8)
    root = rng.normal(size=(6, 6))
    hessian, gradient = root @ root.T, rng.normal(size=6)
    rows, bounds = rng.normal(size=(9, 6)), rng.uniform(0.1, 1.0, size=9)
    found = solve_quadratic_program(csc_array(hessian), gradient, csc_array(rows), bounds)
    expected = minimize(
        lambda x: 0.5 * x @ hessian @ x + gradient @ x,
        np.zeros(6),
        jac=lambda x: hessian @ x + gradient,
        constraints={"type": "ineq", "fun": lambda x: bounds - rows @ x},
        tol=1e-12,
    ).x
    assert found is not None
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_program_without_solution_has_none() -> None:
    rows = csc_array(np.array([[1.0], [-1.0]]))
    assert solve_quadratic_program(csc_array(np.eye(1)), np.zeros(1), rows, -np.ones(2)) is None


def test_points_inside_a_polyhedron() -> None:
    """Pulled out of a ball of half-spaces, each point stops at the boundary nearest to its aim."""
    rng = np.random.default_rng(9)
    hull = convex_hull(rng.normal(size=(200, 3)) * [1.0, 0.5, 2.0])
    inside = PointsInside(hull.normals, hull.heights(hull.centroid))
    points = 0.1 * rng.normal(size=(40, 3))
    aims = 3.0 * rng.normal(size=(40, 3))
    moves = inside.step(points, csc_array(np.eye(120)), points - aims)
    assert moves is not None
    reached = inside.mended(points + moves)
    assert inside.slacks(reached).min() > -1e-14
    for place, aim in zip(reached, aims, strict=True):
        expected = minimize(
            lambda x, aim=aim: 0.5 * (x - aim) @ (x - aim),
            np.zeros(3),
            jac=lambda x, aim=aim: x - aim,
            constraints={"type": "ineq", "fun": lambda x: inside.slacks(x[None])[0]},
        ).x
        np.testing.assert_allclose(place, expected, atol=1e-4)


def test_the_largest_size_inside() -> None:
    """A needle of length 4 in a cube of side 2, off its middle: half its size, in the middle."""
    cube = convex_hull(np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * 1.0)
    inside = PointsInside(cube.normals, cube.heights(np.zeros(3)))
    points = np.array([[5.0, 0.2, 0.0], [3.0, 0.2, 0.0], [1.0, 0.2, 0.0]])
    scaled = inside.largest(points)
    np.testing.assert_allclose(scaled[:, 0], [0.999, 0.0, -0.999], atol=1e-12)
    np.testing.assert_allclose(np.ptp(scaled[:, 1:], axis=0), 0.0, atol=1e-12)
    assert inside.slacks(scaled).min() > 0.0
    # What fits is not enlarged.
    np.testing.assert_allclose(np.ptp(inside.largest(0.1 * points)[:, 0]), 0.3996)
