"""The oracle against closed forms and reference values. `tests/fuzz` compares the product with
it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from common.paths import public_data

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.reading import read_body
from tests.reference import solids
from tests.reference.oracle import OracleError, hull_probabilities, oracle_probabilities

TETRAHEDRON = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
TETRAHEDRON_FACETS = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]]


def ask(hull: ConvexHull, *centers: np.ndarray) -> np.ndarray:
    return np.array([float(p) for p in hull_probabilities(hull, centers)])


def test_a_tetrahedron_to_fifty_digits() -> None:
    exact = oracle_probabilities(TETRAHEDRON, TETRAHEDRON_FACETS, [[0, 0, 0]])
    assert all(abs(4 * p - 1) < 1e-50 for p in exact)


@pytest.mark.parametrize("edges", [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (5.0, 4.0, 0.1)])
def test_a_box_has_its_solid_angles(edges: tuple[float, float, float]) -> None:
    problem = solids.box(*edges)
    answer = ask(convex_hull(problem.points), np.zeros(3))
    np.testing.assert_allclose(np.sort(answer), np.sort(problem.shares), rtol=0, atol=1e-15)


def test_two_centers_are_averaged() -> None:
    hull = convex_hull(solids.box(1.0, 2.0, 3.0).points)
    left, right = np.array([0.1, 0.2, 0.3]), np.array([-0.2, 0.1, 0.2])
    both = (ask(hull, left) + ask(hull, right)) / 2.0
    np.testing.assert_allclose(ask(hull, left, right), both, rtol=0, atol=1e-15)


def test_an_exactly_balanced_body_has_no_answer() -> None:
    """A frustum that overhangs its bottom, with the center of mass above an edge of that."""
    square = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
    points = np.concatenate([np.c_[square, np.zeros(4)], np.c_[2.0 * square, np.full(4, 2.0)]])
    with pytest.raises(OracleError, match="expected a sign, got zero"):
        ask(convex_hull(points), np.array([1.0, 0.25, 1.0]))


def test_facets_of_no_convex_body_are_refused() -> None:
    inside_out = [facet[::-1] for facet in TETRAHEDRON_FACETS]
    with pytest.raises(OracleError):
        oracle_probabilities(TETRAHEDRON, inside_out, [[0.1, 0.2, 0.05]])


def test_a_published_mesh() -> None:
    bodies = {}
    for name, expected in json.loads(public_data("reference_rest.json").read_text()).items():
        body = read_body(public_data(name))
        bodies[len(convex_hull(body.points, single_precision=body.single_precision).normals)] = (
            body,
            expected,
        )
    body, expected = bodies[min(bodies)]
    hull = convex_hull(body.points, single_precision=body.single_precision)
    answer = ask(hull, np.array(expected["center_of_mass"]))
    assert np.count_nonzero(answer) == len(expected["rests"])
    for rest in expected["rests"]:
        facet = int(np.argmax(hull.normals @ rest["normal"]))
        assert answer[facet] == pytest.approx(rest["probability"], abs=1e-12)
