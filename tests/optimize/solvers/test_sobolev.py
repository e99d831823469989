"""The Sobolev operator against dense linear algebra."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.optimize.solvers.sobolev import (
    SobolevGradient,
    SobolevOptions,
    SobolevSolver,
    graph_laplacian,
)

CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


@pytest.fixture(params=["cube", "random"])
def hull(request, random_points) -> ConvexHull:
    return convex_hull(CUBE if request.param == "cube" else random_points(3, 40))


def dense_laplacian(hull: ConvexHull) -> np.ndarray:
    size = len(hull.vertices)
    matrix = np.zeros((size, size))
    for facet in range(len(hull.normals)):
        loop = hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]
        for a, b in zip(loop, np.roll(loop, -1), strict=True):
            matrix[a, b] = matrix[b, a] = -1.0
    return matrix - np.diag(matrix.sum(axis=1))


def test_the_laplacian_is_that_of_the_edge_graph(hull: ConvexHull) -> None:
    laplacian = graph_laplacian(hull).toarray()
    np.testing.assert_array_equal(laplacian, dense_laplacian(hull))
    np.testing.assert_array_equal(laplacian, laplacian.T)
    np.testing.assert_array_equal(laplacian.sum(axis=0), 0.0)
    values = np.linalg.eigvalsh(laplacian)
    assert values[0] == pytest.approx(0.0, abs=1e-12)
    assert values[1] > 0.1


def test_diagonals_of_flat_facets_are_no_edges() -> None:
    assert (graph_laplacian(convex_hull(CUBE)).diagonal() == 3.0).all()


@pytest.mark.parametrize("smoothing", [0.01, 2.0, 50.0])
@pytest.mark.parametrize("power", [1, 2, 3, 4])
def test_the_solver_is_the_dense_inverse(hull: ConvexHull, smoothing: float, power: int) -> None:
    size = len(hull.vertices)
    right = np.random.default_rng(0).normal(size=(size, 3))
    operator = np.eye(size) + smoothing * dense_laplacian(hull)
    expected = right
    for _ in range(power):
        expected = np.linalg.solve(operator, expected)
    options = SobolevOptions(smoothing, power)
    given = right.copy()
    solved = SobolevSolver(graph_laplacian(hull), options).solve(given)
    np.testing.assert_allclose(solved, expected, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(given, right)


def test_constant_vectors_are_preserved(hull: ConvexHull) -> None:
    constant = np.tile([1.0, -2.0, 0.5], (len(hull.vertices), 1))
    for power in (1, 4):
        solver = SobolevSolver(graph_laplacian(hull), SobolevOptions(7.0, power))
        np.testing.assert_allclose(solver.solve(constant), constant, rtol=1e-13)


def test_the_operator_is_symmetric_positive_definite_and_damps(hull: ConvexHull) -> None:
    solver = SobolevSolver(graph_laplacian(hull), SobolevOptions(2.0, 2))
    matrix = solver.solve(np.eye(len(hull.vertices)))
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-14)
    values = np.linalg.eigvalsh(matrix)
    assert values[0] > 0.0
    assert values[-1] == pytest.approx(1.0)
    assert (matrix > 0.0).all()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            {"smoothing": 0.0},
            "sobolev.smoothing: expected a number above 0 and at most 1e+06, got 0",
        ),
        (
            {"smoothing": -1.0},
            "sobolev.smoothing: expected a number above 0 and at most 1e+06, got -1",
        ),
        (
            {"smoothing": np.inf},
            "sobolev.smoothing: expected a number above 0 and at most 1e+06, got inf",
        ),
        (
            {"smoothing": np.nan},
            "sobolev.smoothing: expected a number above 0 and at most 1e+06, got nan",
        ),
        ({"power": 0}, "sobolev.power: expected 1 to 4, got 0"),
        ({"power": 5}, "sobolev.power: expected 1 to 4, got 5"),
    ],
)
def test_bad_options_are_refused_in_words(options: dict[str, float], text: str) -> None:
    with pytest.raises(InputError, match=re.escape(text)):
        SobolevOptions(**options)


@pytest.mark.parametrize("options", [None, SobolevOptions(5.0, 2)])
def test_without_drift_the_mean_stays_and_the_rest_is_as_before(
    random_points, options: SobolevOptions | None
) -> None:
    hull = convex_hull(random_points(4, 30))
    gradient = np.zeros((30, 3))
    gradient[hull.source] = np.random.default_rng(1).normal(size=hull.vertices.shape)
    free = SobolevGradient(options).of(gradient.ravel(), hull).reshape(-1, 3)
    held = SobolevGradient(options, drift=False).of(gradient.ravel(), hull).reshape(-1, 3)
    np.testing.assert_allclose(held.sum(axis=0), 0.0, atol=1e-12)
    shift = (free - held)[hull.source]
    np.testing.assert_allclose(shift, np.tile(shift[0], (len(shift), 1)), atol=1e-12)
    assert (held * gradient).sum() > 0.0
    inside = np.setdiff1d(np.arange(30), hull.source)
    np.testing.assert_array_equal(held[inside], 0.0)
