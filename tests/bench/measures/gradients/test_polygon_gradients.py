"""Derivatives of bodies with facets of many sides, and that wrong ones are noticed."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.bench.bodies import solids
from dicedesign.bench.bodies.problem import Problem, turned
from dicedesign.bench.measures.gradients.gradient_speed import gradient_times
from dicedesign.bench.measures.gradients.polygon_gradients import (
    polygon_bodies,
    polygon_row,
    random_polyhedron,
)
from dicedesign.bench.reference.oracle_derivatives import (
    as_floats,
    broken_derivative,
    corner_motion,
    derivative,
    half_space_motion,
    oracle_derivative,
)
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.shape import Shape
from dicedesign.rest.poses import rest_poses

torch.set_num_threads(1)

STILL = np.zeros(3)


def clustered(points: np.ndarray, center: np.ndarray | None, normals: np.ndarray) -> np.ndarray:
    """Odds (m,) of the rests of points, each counted for the nearest of some normals (m, 3)."""
    poses = rest_poses(points, center, coplanar_tolerance=0.0)
    nearest = np.argmax(poses.normals @ normals.T, axis=1)
    return np.bincount(nearest, poses.probabilities, len(normals))


@pytest.mark.parametrize("name", ["cube", "dodecahedron"])
def test_a_facet_that_breaks_has_the_derivative_of_the_sum_of_its_parts(name: str) -> None:
    """Of the polygon, of its triangles in 60 digits, and by coarse differences of real bodies."""
    hull = convex_hull(turned(solids.platonic(name), 2).points)
    center = hull.centroid + np.array([0.05, -0.02, 0.03])
    along = np.random.default_rng(0).normal(size=hull.vertices.shape)
    motion = corner_motion(hull, center, along, STILL)
    whole, broken = as_floats(derivative(motion)), as_floats(broken_derivative(motion))
    np.testing.assert_allclose(broken, whole, rtol=0, atol=1e-14)
    coarse = np.zeros(len(whole))
    for step in (1e-5, -1e-5):
        moved = hull.vertices + step * along
        assert len(rest_poses(moved, center, coplanar_tolerance=0.0).hull.normals) > len(whole)
        coarse += clustered(moved, center, hull.normals) / (2.0 * step)
    np.testing.assert_allclose(coarse, whole, rtol=0, atol=1e-8)
    rests = evaluate_rests(torch.tensor(hull.vertices), torch.tensor(center))
    np.testing.assert_allclose(rests.jacobian @ along.ravel(), whole[rests.paths.rests], atol=1e-14)


def test_a_uniform_body_has_another_slope_where_a_corner_moves_in() -> None:
    """The volume under a broken facet is what its triangles leave: the kink that `Gradients` of the
    researchers' page tells of."""
    hull = convex_hull(solids.platonic("cube").points)
    along = np.zeros_like(hull.vertices)
    along[0] = hull.vertices[0]
    before = clustered(hull.vertices, None, hull.normals)
    out, into = (
        (clustered(hull.vertices + step * along, None, hull.normals) - before) / step
        for step in (1e-6, -1e-6)
    )
    assert np.abs(out).max() == pytest.approx(1.5 * np.abs(into).max(), rel=1e-4)
    rests = evaluate_rests(torch.tensor(hull.vertices))
    found = np.abs(rests.jacobian @ along.ravel()).max()
    assert 0.999 * np.abs(into).max() <= found <= 1.001 * np.abs(out).max()


@pytest.mark.parametrize("uniform", [True, False])
def test_half_spaces_of_a_box_move_its_odds_as_the_closed_form_says(uniform: bool) -> None:
    edges, speed = np.array([1.0, 2.0, 3.0]), np.array([0.3, -0.2, 0.5])
    hull = convex_hull(solids.box(*edges).points)
    coordinates, parameters = FacetCoordinates.of(hull.vertices, STILL)
    # A facet of the half extent a: the logarithm of a grows by its speed over a.
    logarithms = np.abs(hull.normals) @ (speed / edges)
    along = np.concatenate([np.zeros(3 * len(hull.normals)), logarithms])
    center = None if uniform else STILL
    motion = half_space_motion(hull, center, coordinates.origin, parameters, along)
    exact = as_floats(derivative(motion))
    coarse = np.zeros(len(exact))
    for step in (1e-5, -1e-5):
        # Two for each of the axes z, x, y.
        shares = np.array(solids.box(*(edges + step * speed)).shares)[[2, 4, 0]]
        coarse += np.abs(hull.normals) @ shares / (2.0 * step)
    np.testing.assert_allclose(exact, coarse, rtol=0, atol=1e-9)
    corners = hull.vertices * (speed / edges)
    np.testing.assert_allclose(oracle_derivative(hull, center, corners, STILL), exact, atol=1e-15)


@pytest.mark.parametrize("uniform", [True, False])
def test_derivatives_of_polygons_are_right(uniform: bool) -> None:
    bodies = dict(polygon_bodies())
    for name in ("cube, turned", "antiprism 5", "12 facets apart, as a file"):
        row = polygon_row(name, bodies[name], uniform=uniform)
        assert row.ok
        assert row.worst < 1e-14
        assert (row.broken is None) == (uniform or name.endswith("file"))
        assert (row.half_spaces is None) == name.endswith("file")
    for number in range(4):
        row = polygon_row("random", random_polyhedron(number), uniform=uniform, seed=number)
        assert row.ok
        assert row.sides > 3


def test_a_random_polyhedron_has_three_facets_at_each_corner() -> None:
    for number in range(8):
        hull = convex_hull(random_polyhedron(number).points)
        assert (np.bincount(hull.tail) == 3).all()
        np.testing.assert_array_equal(
            random_polyhedron(number).points, random_polyhedron(number).points
        )


def test_wrong_derivatives_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    body = Problem(solids.box(1.0, 2.0, 3.0).points)
    assert polygon_row("box", body, uniform=True).ok
    in_parameters = Shape.in_parameters
    with monkeypatch.context() as patch:
        patch.setattr(Shape, "in_parameters", lambda *given: 1.0001 * in_parameters(*given))
        wrong = polygon_row("box", body, uniform=True)
        assert not wrong.ok
        assert wrong.half_spaces == pytest.approx(1e-4, rel=1e-6)
        assert wrong.jacobian < 1e-14
    right = RestEvaluation.jacobian.fget
    assert right is not None
    with monkeypatch.context() as patch:
        patch.setattr(RestEvaluation, "jacobian", property(lambda rests: 0.999 * right(rests)))
        wrong = polygon_row("box", body, uniform=False)
        assert not wrong.ok
        assert wrong.error < 1e-14
        for error in (wrong.jacobian, wrong.broken, wrong.half_spaces):
            assert error == pytest.approx(1e-3, rel=1e-6)


def test_times_are_multiples_of_the_hull_s() -> None:
    rows = list(gradient_times(0.0))
    assert [row.rests for row in rows][:3] == [6, 11, 30]
    for row in rows:
        assert row.hull_seconds > 0.0
        assert min(row.odds, row.one, row.jacobian, row.one_by_one, row.half_spaces) > 0.0
