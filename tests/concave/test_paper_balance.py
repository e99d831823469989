"""The balance of a filled surface: where its center of mass goes, and that its hull stays."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import ball, bent_capsule, bumpy_sphere

from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.paper_fill import balance, centering_gradient, hull_keeping_moves
from dicedesign.concave.result import FillStatus
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.descent import SobolevSolver, edge_laplacian

OPTIONS = ConcavePaperOptions()


def ignored(energy: float) -> None:
    """No step is looked at."""


@pytest.mark.parametrize("way", [[0.0, 0.0, 0.0], [0.004, -0.01, 0.003]])
def test_the_center_of_mass_is_met_and_the_hull_stays(way: list[float]) -> None:
    surface = bent_capsule(18, 10)
    hull = convex_hull(surface.points)
    center = surface.centroid + surface.diagonal * np.array(way)
    energies: list[float] = []
    result = balance(surface, surface, hull, center, OPTIONS, energies.append)
    assert result.status is FillStatus.FITTED
    assert result.status is FillStatus.FITTED
    found = surface.with_points(result.points)
    assert np.linalg.norm(found.centroid - center) < 1e-12 * surface.diagonal
    after = convex_hull(result.points)
    np.testing.assert_array_equal(after.source, hull.source)
    np.testing.assert_array_equal(after.vertices, hull.vertices)
    assert energies[-1] == result.energy
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.max() < 0.2


def test_a_convex_surface_cannot_be_balanced() -> None:
    """All its points are corners of the hull and stay."""
    convex = ball(1)
    hull = convex_hull(convex.points)
    result = balance(convex, convex, hull, np.array([0.05, 0.0, 0.0]), OPTIONS, ignored)
    assert result.status is FillStatus.NO_PROGRESS
    np.testing.assert_array_equal(result.points, convex.points)


def centroid_of(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Center of mass, tetrahedron by tetrahedron from the origin."""
    volume, moment = 0.0, np.zeros(3)
    for a, b, c in points[triangles]:
        part = float(np.dot(a, np.cross(b, c))) / 6.0
        volume += part
        moment += part * (a + b + c) / 4.0
    return moment / volume


def test_the_gradient_of_the_distance_of_the_center_of_mass() -> None:
    """Eq. 33, by finite differences."""
    surface, place = bumpy_sphere(1), np.array([5.1, -1.8, 0.7])
    gradient = centering_gradient(surface, place)
    for point, axis in [(0, 0), (7, 1), (20, 2), (41, 0)]:
        energies = []
        for step in (1e-5, -1e-5):
            points = surface.points.copy()
            points[point, axis] += step
            energies.append(((centroid_of(points, surface.triangles) - place) ** 2).sum())
        slope = (energies[0] - energies[1]) / 2e-5
        assert gradient[point, axis] == pytest.approx(slope, rel=1e-5, abs=1e-10)


@pytest.mark.parametrize(("gamma", "power"), [(5.0, 2), (40.0, 3)])
def test_moves_are_those_of_eq_35(gamma: float, power: int) -> None:
    """`D (I + gamma L)^-p D g`, with matrices written down entry by entry."""
    surface = bumpy_sphere(1)
    count = len(surface.points)
    operator = np.eye(count)
    edges = {
        frozenset((t[i], t[(i + 1) % 3])) for t in surface.triangles.tolist() for i in range(3)
    }
    for a, b in map(sorted, edges):
        for i, j in ((a, b), (b, a)):
            operator[i, i] += gamma
            operator[i, j] -= gamma
    hull = convex_hull(surface.points)
    depths = np.array(
        [
            min((hull.polygon(f)[0] - x) @ n for f, n in enumerate(hull.normals))
            for x in surface.points
        ]
    )
    gradient = np.random.default_rng(1).normal(size=(count, 3))
    expected = np.diag(depths) @ gradient
    for _ in range(power):
        expected = np.linalg.inv(operator) @ expected
    expected = np.diag(depths) @ expected
    tails, heads = surface.triangles.ravel(), np.roll(surface.triangles, -1, axis=1).ravel()
    solver = SobolevSolver(edge_laplacian(tails, heads, count), SobolevOptions(gamma, power))
    moves, _ = hull_keeping_moves(solver, depths, gradient)
    np.testing.assert_allclose(moves, expected, atol=1e-12 * np.abs(gradient).max())
    assert (moves * gradient).sum() > 0.0
