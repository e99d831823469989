"""The paper's hull fill: quadratic programs, their energy, and the balance."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import numpy as np
import pytest
import trimesh
from common.bumpy import ball, bent_capsule, bumpy_sphere, nearby_hull
from scipy import spatial
from scipy.optimize import minimize
from scipy.sparse import csc_array

from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.paper_fill import (
    ClosestPointEnergy,
    PointsInside,
    balance,
    centering_gradient,
    fill_as_paper,
    fill_by_quadratic_programs,
)
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats

needs_clarabel = pytest.mark.skipif(
    find_spec("clarabel") is None,
    reason="the optional extra 'concave' is not installed",
)


def fill(surface: Surface, hull: ConvexHull, **options: float) -> tuple[Floats, Floats]:
    """Points of the filled surface, and distances of the hull's vertices from it over its
    diagonal."""
    energies: list[float] = []
    filled = fill_by_quadratic_programs(
        surface, hull, ConcavePaperOptions(**options), energies.append
    )
    points, energy = filled
    assert energies[-1] == energy
    middle = hull.vertices.mean(axis=0)
    assert (hull.heights(middle) - (points - middle) @ hull.normals.T).min() > 0.0
    distances = np.sqrt(closest_squares(surface.with_points(points), hull.vertices))
    return points, distances / surface.diagonal


def closest_squares(surface: Surface, corners: Floats) -> Floats:
    """(v,) squared distances of points from a surface, one triangle after the other."""
    triangles = surface.points[surface.triangles]
    feet = [
        trimesh.triangles.closest_point(triangles, np.tile(corner, (len(triangles), 1)))
        for corner in corners
    ]
    return ((np.array(feet) - corners[:, None]) ** 2).sum(axis=2).min(axis=1)


@needs_clarabel
@pytest.mark.parametrize(
    ("surface", "amount"), [(bumpy_sphere(), 0.04), (bent_capsule(18, 10), 0.02)]
)
def test_the_surface_spans_the_hull(surface: Surface, amount: float) -> None:
    hull = nearby_hull(surface, amount)
    points, distances = fill(surface, hull)
    assert distances.mean() <= 1e-3
    volumes = [spatial.ConvexHull(corners).volume for corners in (points, hull.vertices)]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)
    moved = np.linalg.norm(points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 1.5 * amount


def test_without_clarabel_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "clarabel", None)
    surface = bumpy_sphere(1)
    with pytest.raises(InputError, match=r"pip install 'dicedesign\[concave\]'"):
        fill(surface, nearby_hull(surface, 0.02))


SURFACE = bumpy_sphere(1)
CORNERS = nearby_hull(bumpy_sphere(2), 0.05).vertices


def test_the_closest_point_energy_is_eq_28_and_quadratic() -> None:
    points, random = SURFACE.points, np.random.default_rng(3)
    energy, move = ClosestPointEnergy.of(SURFACE, CORNERS), 0.3 * random.normal(size=points.shape)
    assert energy.value(points) == pytest.approx(closest_squares(SURFACE, CORNERS).sum(), rel=1e-12)
    flat = move.ravel()
    change = (energy.gradient(points) * move).sum() + 0.5 * flat @ (energy.hessian @ flat)
    moved = SURFACE.with_points(points + move)
    assert energy.value(moved.points) == pytest.approx(energy.value(points) + change, rel=1e-12)
    # The former closest points are not closer than the new ones.
    assert energy.value(moved.points) >= closest_squares(moved, CORNERS).sum()


@needs_clarabel
def test_points_inside_a_polyhedron() -> None:
    """Each point stops at the boundary point nearest to its aim."""
    rng = np.random.default_rng(9)
    hull = convex_hull(rng.normal(size=(200, 3)) * [1.0, 0.5, 2.0])
    inside = PointsInside(hull.normals, hull.heights(hull.centroid))
    points = 0.1 * rng.normal(size=(40, 3))
    aims = 3.0 * rng.normal(size=(40, 3))
    moves = inside.step(points, csc_array(np.eye(120)), points - aims)
    reached = inside.pull_inside(points + moves)
    assert inside.slacks(reached).min() > -1e-14
    for place, aim in zip(reached, aims, strict=True):
        expected = minimize(
            lambda x, aim=aim: 0.5 * (x - aim) @ (x - aim),
            np.zeros(3),
            jac=lambda x, aim=aim: x - aim,
            constraints={"type": "ineq", "fun": lambda x: inside.slacks(x[None])[0]},
        ).x
        np.testing.assert_allclose(place, expected, atol=1e-4)


# The balance.

OPTIONS = ConcavePaperOptions()


@pytest.mark.parametrize("direction", [[0.0, 0.0, 0.0], [0.004, -0.01, 0.003]])
def test_the_balance_moves_the_center_of_mass_and_keeps_the_hull(direction: list[float]) -> None:
    surface = bent_capsule(18, 10)
    hull = convex_hull(surface.points)
    center = surface.centroid + surface.diagonal * np.array(direction)
    energies: list[float] = []
    points, energy = balance(surface, surface, hull, center, OPTIONS, energies.append)
    miss = surface.with_points(points).centroid - center
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal
    after = convex_hull(points)
    np.testing.assert_array_equal(after.source, hull.source)
    np.testing.assert_array_equal(after.vertices, hull.vertices)
    assert energies[-1] == energy
    moved = np.linalg.norm(points - surface.points, axis=1) / surface.diagonal
    assert moved.max() < 0.2


@needs_clarabel
def test_a_fill_with_a_given_center_of_mass() -> None:
    surface = bumpy_sphere(1)
    hull = nearby_hull(surface, 0.03)
    center = hull.centroid + surface.diagonal * np.array([0.004, -0.01, 0.003])
    filled = fill_as_paper(surface, hull, center, OPTIONS, lambda stage, energy: None)
    miss = centroid_of(filled[0], surface.triangles) - center
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal


def test_a_convex_surface_stays_as_it_is() -> None:
    """All its points are vertices of the hull."""
    convex, center = ball(1), np.array([0.05, 0.0, 0.0])
    hull = convex_hull(convex.points)
    points, _ = balance(convex, convex, hull, center, OPTIONS, lambda energy: None)
    np.testing.assert_array_equal(points, convex.points)


def centroid_of(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Center of mass from tetrahedra with a corner at the origin."""
    volume, moment = 0.0, np.zeros(3)
    for a, b, c in points[triangles]:
        part = float(np.dot(a, np.cross(b, c))) / 6.0
        volume += part
        moment += part * (a + b + c) / 4.0
    return moment / volume


def test_the_centering_gradient_is_eq_33_by_finite_differences() -> None:
    surface = bumpy_sphere(1)
    surface = surface.with_points(surface.points - [5.1, -1.8, 0.7])
    gradient = centering_gradient(surface)
    for point, axis in [(0, 0), (7, 1), (20, 2), (41, 0)]:
        energies = []
        for step in (1e-5, -1e-5):
            points = surface.points.copy()
            points[point, axis] += step
            energies.append((centroid_of(points, surface.triangles) ** 2).sum())
        slope = (energies[0] - energies[1]) / 2e-5
        assert gradient[point, axis] == pytest.approx(slope, rel=1e-5, abs=1e-10)
