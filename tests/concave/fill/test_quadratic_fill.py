"""The hull fill by quadratic programs on small surfaces, and the programs themselves."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere, nearby_hull
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csc_array

from dicedesign.concave.fill import quadratic_program
from dicedesign.concave.fill.elastic_energy import ElasticEnergy, ElasticWeights
from dicedesign.concave.fill.quadratic_fill import QuadraticFillOptions, fill_by_quadratic_programs
from dicedesign.concave.fill.quadratic_program import PointsInside, solve_quadratic_program
from dicedesign.concave.fill.result import FillResult, FillStatus, FillStep
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.surface import Surface

Floats = NDArray[np.float64]

needs_clarabel = pytest.mark.skipif(
    find_spec("clarabel") is None,
    reason="the optional extra 'concave' is not installed",
)


def rows_of(points: Floats) -> list[list[float]]:
    return sorted(points.tolist())


def check_fit(result: FillResult, surface: Surface, hull: ConvexHull) -> None:
    """The surface's hull is the wanted one to the last bit, and nothing is outside."""
    assert result.converged
    assert result.status is FillStatus.FITTED
    assert result.message == "reached what was wanted"
    assert rows_of(convex_hull(result.points).vertices) == rows_of(hull.vertices)
    assert result.gap < 1e-14
    slacks = hull.heights(np.zeros(3)) - result.points @ hull.normals.T
    assert slacks.min() > -1e-14 * surface.diagonal


@needs_clarabel
@pytest.mark.parametrize(
    ("surface", "amount"), [(bumpy_sphere(), 0.04), (bent_capsule(18, 10), 0.02)]
)
def test_the_hull_is_the_wanted_one(surface: Surface, amount: float) -> None:
    hull = nearby_hull(surface, amount)
    steps: list[FillStep] = []
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions(), on_step=steps.append)
    check_fit(result, surface, hull)
    assert tuple(steps) == result.history
    assert [step.step for step in steps] == list(range(len(steps)))
    assert all(step.outside < 1e-13 for step in steps)
    assert set(steps[0].terms) == {"closeness", "membrane", "bending"}
    moved = np.linalg.norm(result.points - surface.points, axis=1) / surface.diagonal
    assert moved.mean() < 1.5 * amount
    assert moved.max() < 3.0 * amount


@needs_clarabel
def test_known_corners_are_put_in_place() -> None:
    surface = bumpy_sphere()
    hull = nearby_hull(surface, 0.03)
    corners = convex_hull(surface.points).source[hull.source]
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions(), corners=corners)
    check_fit(result, surface, hull)
    np.testing.assert_array_equal(result.points[corners], hull.vertices)
    # The same points are found from the hull alone, and the same surface.
    found = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions())
    np.testing.assert_allclose(found.points, result.points, atol=0.01 * surface.diagonal)


@needs_clarabel
def test_the_elastic_energy_is_least() -> None:
    """No move of the points that are off the hull lowers it."""
    surface = bumpy_sphere()
    hull = nearby_hull(surface, 0.03)
    weights = ElasticWeights(1.0, 0.05)
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions(elastic=weights))
    energy = ElasticEnergy.of(surface, weights)
    slacks = (hull.heights(np.zeros(3)) - result.points @ hull.normals.T).min(axis=1)
    free = slacks > 0.01 * surface.diagonal
    assert free.sum() > 20
    pulls = np.linalg.norm(energy.gradient(result.points), axis=1)
    assert pulls[free].max() < 0.02 * pulls[~free].max()


@needs_clarabel
def test_its_own_hull_leaves_a_surface_as_it_is() -> None:
    surface = bumpy_sphere()
    hull = convex_hull(surface.points)
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions())
    check_fit(result, surface, hull)
    np.testing.assert_allclose(result.points, surface.points, atol=1e-3 * surface.diagonal)


@needs_clarabel
def test_the_center_of_mass_is_met_to_first_order() -> None:
    surface = bent_capsule(18, 10)
    hull = nearby_hull(surface, 0.03)
    center = surface.centroid - np.array([0.015, 0.0, 0.0]) * surface.diagonal
    options = QuadraticFillOptions()
    result = fill_by_quadratic_programs(surface, hull, options, center_of_mass=center)
    check_fit(result, surface, hull)
    found = surface.moved(result.points).centroid
    assert np.linalg.norm(found - center) < 1e-4 * surface.diagonal


@needs_clarabel
def test_a_hull_with_more_corners_than_that_of_the_surface() -> None:
    surface = bumpy_sphere(1)
    offsets = surface.points - surface.centroid
    round_ball = surface.centroid + 1.1 * offsets / np.linalg.norm(offsets, axis=1)[:, None]
    assert len(convex_hull(surface.points).vertices) < 40
    hull = convex_hull(np.delete(round_ball, [5, 20], axis=0))
    assert len(hull.vertices) == 40
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions())
    check_fit(result, surface, hull)


@needs_clarabel
def test_a_hull_far_away_from_the_surface() -> None:
    """The surface begins in the hull wherever it was."""
    surface = bumpy_sphere()
    hull = convex_hull(convex_hull(surface.points).vertices + 100.0)
    corners = convex_hull(surface.points).source[hull.source]
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions(), corners=corners)
    check_fit(result, surface, hull)
    np.testing.assert_allclose(result.points, surface.points + 100.0, atol=0.01)


def test_more_corners_than_points_are_refused() -> None:
    fine, coarse = bumpy_sphere(2), bumpy_sphere(1)
    with pytest.raises(InputError, match="expected at most 42 corners"):
        fill_by_quadratic_programs(coarse, convex_hull(fine.points), QuadraticFillOptions())


def test_corners_must_be_as_many_as_those_of_the_hull() -> None:
    surface = bumpy_sphere()
    hull = convex_hull(surface.points)
    corners = np.zeros(len(hull.vertices), dtype=np.int64)
    with pytest.raises(InputError, match=f"expected {len(corners)} different points"):
        fill_by_quadratic_programs(surface, hull, QuadraticFillOptions(), corners=corners)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"closeness": 0.0}, "closeness: expected a positive number, got 0"),
        ({"growth": 1.0}, "growth: expected a number above 1, got 1"),
        ({"steps": 0}, "steps: expected a whole number above 0, got 0"),
    ],
)
def test_options_out_of_range(options: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        QuadraticFillOptions(**options)  # type: ignore[arg-type]


def test_without_clarabel_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "clarabel", None)
    surface = bumpy_sphere(1)
    with pytest.raises(InputError, match=r"pip install 'dicedesign\[concave\]'"):
        fill_by_quadratic_programs(surface, nearby_hull(surface, 0.02), QuadraticFillOptions())


@needs_clarabel
def test_what_is_said_when_it_ends_before() -> None:
    surface = bent_capsule(14, 8)
    hull, options = nearby_hull(surface, 0.03), QuadraticFillOptions(steps=1)
    center = surface.centroid - np.array([0.02, 0.0, 0.0]) * surface.diagonal
    result = fill_by_quadratic_programs(surface, hull, options, center_of_mass=center)
    assert result.status is FillStatus.STEP_LIMIT
    assert not result.converged
    assert "allow more steps" in result.message
    assert rows_of(convex_hull(result.points).vertices) == rows_of(hull.vertices)


def test_a_program_that_cannot_be_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = bumpy_sphere(1)
    monkeypatch.setattr(quadratic_program, "solve_quadratic_program", lambda *given: None)
    hull = nearby_hull(surface, 0.05)
    result = fill_by_quadratic_programs(surface, hull, QuadraticFillOptions())
    assert result.status is FillStatus.UNSOLVED
    assert "remesh the surface" in result.message
    assert len(result.history) == 1
    slacks = hull.heights(np.zeros(3)) - result.points @ hull.normals.T
    assert slacks.min() > 0.0


@needs_clarabel
def test_a_quadratic_program_against_scipy() -> None:
    rng = np.random.default_rng(8)
    root = rng.normal(size=(6, 6))
    hessian, gradient = root @ root.T, rng.normal(size=6)
    rows, bounds = rng.normal(size=(9, 6)), rng.uniform(0.1, 1.0, size=9)
    found = solve_quadratic_program(csc_array(hessian), gradient, csc_array(rows), bounds, 2)
    expected = minimize(
        lambda x: 0.5 * x @ hessian @ x + gradient @ x,
        np.zeros(6),
        jac=lambda x: hessian @ x + gradient,
        constraints=[
            {"type": "eq", "fun": lambda x: bounds[:2] - rows[:2] @ x},
            {"type": "ineq", "fun": lambda x: bounds[2:] - rows[2:] @ x},
        ],
        tol=1e-12,
    ).x
    assert found is not None
    np.testing.assert_allclose(found, expected, atol=1e-6)


@needs_clarabel
def test_a_program_without_solution_has_none() -> None:
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
    known = np.array([3, 17])
    moves = inside.step(
        points, csc_array(np.eye(120)), points - aims, known, aims[known] - points[known]
    )
    assert moves is not None
    np.testing.assert_array_equal(moves[known], aims[known] - points[known])
    free = np.delete(np.arange(40), known)
    reached = inside.mended(points + moves)[free]
    assert inside.slacks(reached).min() > -1e-14
    for place, aim in zip(reached, aims[free], strict=True):
        expected = minimize(
            lambda x, aim=aim: 0.5 * (x - aim) @ (x - aim),
            np.zeros(3),
            jac=lambda x, aim=aim: x - aim,
            constraints={"type": "ineq", "fun": lambda x: inside.slacks(x[None])[0]},
        ).x
        np.testing.assert_allclose(place, expected, atol=1e-4)


def test_the_largest_size_inside() -> None:
    cube = convex_hull(np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * 1.0)
    inside = PointsInside(cube.normals, cube.heights(np.zeros(3)))
    points = np.array([[3.0, 0.0, 0.0], [0.5, 0.5, 0.5], [-1.0, 0.0, 0.0]])
    scaled = inside.largest(points, np.array([0.5, 0.0, 0.0]))
    middle = np.array([0.5, 0.0, 0.0])
    np.testing.assert_allclose(scaled - middle, 0.1998 * (points - middle), atol=1e-15)
    assert inside.slacks(scaled).min() > 0.0
    away = inside.largest(points + 10.0, np.array([10.5, 10.0, 10.0]))
    assert inside.slacks(away).min() > 0.0
    np.testing.assert_allclose(inside.largest(0.1 * points, np.zeros(3)), 0.1 * points)
