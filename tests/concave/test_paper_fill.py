"""The hull fill by quadratic programs: its energy, its programs, and small surfaces filled."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere, nearby_hull
from scipy import spatial
from scipy.optimize import minimize
from scipy.sparse import csc_array

from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.paper_fill import (
    ClosestPointEnergy,
    PointsInside,
    fill_by_quadratic_programs,
    solve_quadratic_program,
)
from dicedesign.concave.result import FillResult, FillStatus
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats

needs_clarabel = pytest.mark.skipif(
    find_spec("clarabel") is None,
    reason="the optional extra 'concave' is not installed",
)


def fill(
    surface: Surface, hull: ConvexHull, **options: float
) -> tuple[FillResult, list[float], Floats]:
    """Filled; the distances of the hull's corners from the surface are over its diagonal."""
    energies: list[float] = []
    result = fill_by_quadratic_programs(
        surface, hull, ConcavePaperOptions(**options), energies.append
    )
    assert energies[-1] == result.energy
    middle = hull.vertices.mean(axis=0)
    slacks = hull.heights(middle) - (result.points - middle) @ hull.normals.T
    assert slacks.min() > 0.0
    corners = result.points[surface.triangles]
    distances = [
        np.linalg.norm(
            trimesh.triangles.closest_point(corners, np.repeat(corner[None], len(corners), axis=0))
            - corner,
            axis=1,
        ).min()
        for corner in hull.vertices
    ]
    return result, energies, np.array(distances) / surface.diagonal


def bent_by(surface: Surface, points: Floats) -> float:
    """Sum of squared changes of angle between neighboring triangles."""
    angles = []
    for places in (surface.points, points):
        mesh = trimesh.Trimesh(places, surface.triangles, process=False)
        angles.append(np.where(mesh.face_adjacency_convex, 1, -1) * mesh.face_adjacency_angles)
    return float(((angles[1] - angles[0]) ** 2).sum())


@needs_clarabel
@pytest.mark.parametrize(
    ("surface", "amount"), [(bumpy_sphere(), 0.04), (bent_capsule(18, 10), 0.02)]
)
def test_the_surface_spans_the_hull(surface: Surface, amount: float) -> None:
    hull = nearby_hull(surface, amount)
    result, _, distances = fill(surface, hull)
    assert result.status is FillStatus.FITTED
    assert distances.mean() <= 1e-3
    volumes = [spatial.ConvexHull(points).volume for points in (result.points, hull.vertices)]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 1.5 * amount


@needs_clarabel
def test_what_resists_bending_bends_less() -> None:
    surface = bumpy_sphere()
    hull = nearby_hull(surface, 0.04)
    soft, stiff = (fill(surface, hull, bending=weight)[0].points for weight in (1e-4, 1.0))
    assert bent_by(surface, stiff) < 0.8 * bent_by(surface, soft)


def test_without_clarabel_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "clarabel", None)
    surface = bumpy_sphere(1)
    with pytest.raises(InputError, match=r"pip install 'dicedesign\[concave\]'"):
        fill(surface, nearby_hull(surface, 0.02))


SURFACE = bumpy_sphere(1)
CORNERS = nearby_hull(bumpy_sphere(2), 0.05).vertices


def transcribed(points: Floats) -> float:
    """`sum_p |p - CP(p)|^2`, one corner and one triangle after the other."""
    total = 0.0
    for corner in CORNERS:
        least = np.inf
        for triangle in SURFACE.triangles:
            foot = trimesh.triangles.closest_point(points[triangle][None], corner[None])[0]
            least = min(least, float(((corner - foot) ** 2).sum()))
        total += least
    return total


def energy_at(points: Floats) -> ClosestPointEnergy:
    return ClosestPointEnergy.of(Surface(points, SURFACE.triangles), CORNERS)


def test_the_energy_is_eq_28() -> None:
    assert energy_at(SURFACE.points).value(SURFACE.points) == pytest.approx(
        transcribed(SURFACE.points), rel=1e-12
    )


def test_gradient_and_hessian_tell_all_while_the_closest_points_stay() -> None:
    held = energy_at(SURFACE.points)
    move = 0.3 * np.random.default_rng(3).normal(size=SURFACE.points.shape)
    flat = move.ravel()
    change = (held.gradient(SURFACE.points) * move).sum() + 0.5 * flat @ (held.hessian @ flat)
    moved = SURFACE.points + move
    assert held.value(moved) == pytest.approx(held.value(SURFACE.points) + change, rel=1e-12)
    # Where they were is not nearer than where they are.
    assert held.value(moved) >= transcribed(moved)


@needs_clarabel
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
    rows = csc_array(np.array([[1.0], [-1.0]]))
    assert solve_quadratic_program(csc_array(np.eye(1)), np.zeros(1), rows, -np.ones(2)) is None


@needs_clarabel
def test_points_inside_a_polyhedron() -> None:
    """Pulled out of a ball of half-spaces, each point stops at the boundary nearest to its aim."""
    rng = np.random.default_rng(9)
    hull = convex_hull(rng.normal(size=(200, 3)) * [1.0, 0.5, 2.0])
    inside = PointsInside(hull.normals, hull.heights(hull.centroid))
    points = 0.1 * rng.normal(size=(40, 3))
    aims = 3.0 * rng.normal(size=(40, 3))
    moves = inside.step(points, csc_array(np.eye(120)), points - aims)
    assert moves is not None
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
