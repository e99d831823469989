"""How far a surface is displaced, against the whole of it moved by a dense system and laid back."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from common.bumpy import bumpy_sphere, unit
from scipy.spatial.distance import cdist

from dicedesign.concave.hull_problem import HullProblem
from dicedesign.concave.space_elasticity import FREE
from dicedesign.geometry.procrustes import best_similarity
from dicedesign.runtime.arrays import Floats

SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])


@cache
def problem() -> HullProblem:
    surface = bumpy_sphere()
    return HullProblem(unit(surface.moved(surface.points @ SHEAR)), np.array([0.5, 0.5]), 0.004)


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
            ahead = surface.moved(points + shift).centroid
            behind = surface.moved(points - shift).centroid
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
    return float(np.tensordot(np.tensordot(problem().squared_displacement, moved, 2), moved, 2))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("smooth", [True, False])
def test_it_is_what_a_similarity_leaves(seed: int, smooth: bool) -> None:
    points, random = problem().surface.points, np.random.default_rng(seed)
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


def test_similarities_are_none() -> None:
    """Next to none: by the corners alone a body is not turned quite as a whole."""
    corners = problem().hull.vertices
    turned = [np.cross(axis, corners) for axis in np.eye(3)]
    for moved in (*turned, corners):
        assert square(moved) < 1e-4 * (moved * moved).sum(axis=1).mean()
    # The center of mass stays, so this is another shape.
    shifted = np.tile([1.0, 0.0, 0.0], (len(corners), 1))
    assert square(shifted) > 0.1


def test_it_is_a_quadratic_form_that_is_nowhere_negative() -> None:
    size = problem().squared_displacement.shape[0] * 3
    form = problem().squared_displacement.reshape(size, size)
    np.testing.assert_allclose(form, form.T, atol=1e-12 * np.abs(form).max())
    values = np.linalg.eigvalsh(form)
    assert values.min() > -1e-9 * values.max()
