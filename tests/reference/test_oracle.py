"""The oracle against closed forms, published values and derivatives of the model. `tests/fuzz`
compares the product with it."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from common.paths import public_data

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.reading import read_body
from dicedesign.geometry.sphere import norms
from dicedesign.gradient.rest_probabilities import evaluate_rests
from tests.reference import extremes, solids
from tests.reference.measurement import OK, measure, verdict
from tests.reference.oracle import OracleError, hull_probabilities, oracle_probabilities
from tests.reference.oracle_derivatives import derivative_condition, probability_condition
from tests.reference.problem import rotate_problem
from tests.reference.random_hulls import random_hull
from tests.reference.stiff import grazing_body

TETRAHEDRON = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
TETRAHEDRON_FACETS = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]]


def ask(hull: ConvexHull, *centers: np.ndarray) -> np.ndarray:
    return np.array([float(p) for p in hull_probabilities(hull, centers)])


def test_a_tetrahedron_to_fifty_digits() -> None:
    exact = oracle_probabilities(TETRAHEDRON, TETRAHEDRON_FACETS, [[0, 0, 0]])
    assert all(abs(4 * p - 1) < 1e-50 for p in exact)


def test_boxes_have_their_solid_angles_and_two_centers_are_averaged() -> None:
    for edges in ((1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (5.0, 4.0, 0.1)):
        problem = solids.box(*edges)
        answer = ask(convex_hull(problem.points), np.zeros(3))
        np.testing.assert_allclose(np.sort(answer), np.sort(problem.shares), rtol=0, atol=1e-15)
    hull = convex_hull(solids.box(1.0, 2.0, 3.0).points)
    left, right = np.array([0.1, 0.2, 0.3]), np.array([-0.2, 0.1, 0.2])
    both = (ask(hull, left) + ask(hull, right)) / 2.0
    np.testing.assert_allclose(ask(hull, left, right), both, rtol=0, atol=1e-15)


def test_bodies_without_an_answer() -> None:
    """A frustum that overhangs its bottom, with the center of mass above an edge of that; and
    facets of no convex body."""
    square = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
    points = np.concatenate([np.c_[square, np.zeros(4)], np.c_[2.0 * square, np.full(4, 2.0)]])
    hull, center = convex_hull(points), np.array([1.0, 0.25, 1.0])
    with pytest.raises(OracleError, match="expected a sign, got zero"):
        ask(hull, center)
    assert probability_condition(hull, center) == 0.0
    inside_out = [facet[::-1] for facet in TETRAHEDRON_FACETS]
    with pytest.raises(OracleError):
        oracle_probabilities(TETRAHEDRON, inside_out, [[0.1, 0.2, 0.05]])


def test_a_published_mesh() -> None:
    bodies = {}
    for name, expected in json.loads(public_data("reference_rest.json").read_text()).items():
        body = read_body(public_data(name))
        hull = convex_hull(body.points, single_precision=body.single_precision)
        bodies[len(hull.normals)] = hull, expected
    hull, expected = bodies[min(bodies)]
    answer = ask(hull, np.array(expected["center_of_mass"]))
    assert np.count_nonzero(answer) == len(expected["rests"])
    for rest in expected["rests"]:
        facet = int(np.argmax(hull.normals @ rest["normal"]))
        assert answer[facet] == pytest.approx(rest["probability"], abs=1e-12)


@pytest.mark.parametrize("facets", [19, 18, 14])
def test_a_monostatic_body_has_one_rest_in_any_orientation(facets: int) -> None:
    body = extremes.conway_guy() if facets == 19 else extremes.unistable(facets)
    measurement = measure(body)
    assert (measurement.facets, measurement.rests, measurement.tied) == (facets, 1, False)
    assert measurement.errors == {"closed form": 0.0, "oracle": 0.0}
    for seed in range(3):
        measurement = measure(rotate_problem(body, seed), oracle=seed == 0)
        assert verdict(measurement, rests=1) == OK


@pytest.mark.parametrize("number", [0, 5])
def test_conditions_are_near_the_bound_by_derivatives(number: int) -> None:
    """Random moves of coordinates change probabilities by a tenth to all of the largest possible
    change. The first body is uniform."""
    problem = random_hull(number)[1]
    uniform = problem.center is None
    assert uniform == (number < 4)
    points = torch.tensor(problem.points, requires_grad=True)
    rests = evaluate_rests(points, None if uniform else torch.tensor(problem.center))
    reaches = np.repeat(norms(problem.points - rests.equilibria.center_of_mass), 3)
    if problem.center is not None:
        most = float((np.abs(rests.jacobian) @ reaches).max())
        assert 0.1 * most < probability_condition(rests.hull, problem.center) <= most

    along = np.random.default_rng(number).normal(size=problem.points.shape)
    slopes, bends = [], []
    for probability in rests.probabilities:
        (gradient,) = torch.autograd.grad(probability, points, create_graph=True)
        slope = (gradient * torch.tensor(along)).sum()
        (bend,) = torch.autograd.grad(slope, points, retain_graph=True)
        slopes.append(abs(slope.item()))
        bends.append(float(np.abs(bend.numpy().ravel()) @ reaches))
    most = max(bends) / max(slopes)
    source = rests.hull.source
    condition = derivative_condition(rests.hull, problem.center, along[source], np.zeros(3))
    assert 0.1 * most < condition <= most


def test_conditions_grow_where_a_path_grazes() -> None:
    for power in (3, 9):
        body = grazing_body(10.0**-power, 10.0 ** (-power - 2))
        assert body.center is not None
        hull = convex_hull(body.points)
        assert 0.01 < probability_condition(hull, body.center) * 10.0**-power < 10.0
        along = np.random.default_rng(power).normal(size=hull.vertices.shape)
        condition = derivative_condition(hull, body.center, along, np.zeros(3))
        assert 0.1 < condition * 10.0**-power < 1e3
