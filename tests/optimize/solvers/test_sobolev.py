"""The Sobolev operator and one step to target probabilities, against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.optimize.coordinates import VertexCoordinates
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker, LevenbergMarquardt
from dicedesign.optimize.solvers.descent import SobolevGradient, SobolevSolver, graph_laplacian
from dicedesign.rest.poses import rest_poses

CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def dense_laplacian(hull: ConvexHull) -> np.ndarray:
    """Of the edge graph."""
    matrix = np.zeros((len(hull.vertices),) * 2)
    for facet in range(len(hull.normals)):
        loop = hull.tail[hull.facet_start[facet] : hull.facet_start[facet + 1]]
        for a, b in zip(loop, np.roll(loop, -1), strict=True):
            matrix[a, b] = matrix[b, a] = -1.0
    return matrix - np.diag(matrix.sum(axis=1))


def test_the_solver_is_the_dense_inverse(random_points) -> None:
    for points in (CUBE, random_points(3, 40)):
        hull = convex_hull(points)
        laplacian = graph_laplacian(hull)
        np.testing.assert_array_equal(laplacian.toarray(), dense_laplacian(hull))
        right = np.random.default_rng(0).normal(size=hull.vertices.shape)
        for smoothing, power in ((0.01, 1), (50.0, 4)):
            operator = np.eye(len(right)) + smoothing * dense_laplacian(hull)
            expected, given = right, right.copy()
            for _ in range(power):
                expected = np.linalg.solve(operator, expected)
            solved = SobolevSolver(laplacian, SobolevOptions(smoothing, power)).solve(given)
            np.testing.assert_allclose(solved, expected, rtol=1e-9, atol=1e-11)
            np.testing.assert_array_equal(given, right)


@pytest.mark.parametrize("options", [None, SobolevOptions(5.0, 2)])
def test_without_drift_the_mean_stays(random_points, options: SobolevOptions | None) -> None:
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


torch.set_num_threads(1)


def first_candidate() -> tuple[CandidateMaker, Candidate]:
    points = unit_vectors(np.random.default_rng(5).normal(size=(9, 3)))
    coordinates, parameters = VertexCoordinates.of(points, convex_hull(points).centroid)
    maker = CandidateMaker(None)
    candidate = maker.attempt(coordinates, parameters, rest_poses(points).normals)
    assert candidate is not None
    return maker, candidate


@pytest.mark.parametrize("options", [None, SobolevOptions(1.5, 1), SobolevOptions(0.7, 2)])
def test_a_step_is_the_shortest_in_its_metric(options: SobolevOptions | None) -> None:
    """With little damping, s^T W s is least among steps s with J s = q - p."""
    maker, candidate = first_candidate()
    shift = 2e-4 * np.cos(np.arange(len(candidate.probabilities)))
    target = candidate.probabilities + shift - shift.mean()
    candidates: list[Candidate] = []
    approach = LevenbergMarquardt(
        target,
        maker,
        1e-13,
        options,
        out_of_time=lambda: len(candidates) > 1,
        on_candidate=candidates.append,
    )
    approach.solve(candidate)
    step = candidates[1].parameters - candidate.parameters

    probabilities = candidate.jacobian(candidate.rests.probabilities[candidate.rest_of_face])
    hull = candidate.rests.hull
    metric = np.eye(probabilities.shape[1])
    if options is not None:
        laplacian = graph_laplacian(hull).toarray()
        one = np.eye(len(laplacian)) + options.smoothing * laplacian
        metric = np.kron(np.linalg.matrix_power(one, options.power), np.eye(3))
    # Probabilities sum to 1, so that the last row says nothing new.
    rows, misses = probabilities[:-1], (target - candidate.probabilities)[:-1]
    zeros = np.zeros((len(rows), len(rows)))
    conditions = np.block([[metric, rows.T], [rows, zeros]])
    shortest = np.linalg.solve(conditions, np.concatenate([np.zeros(len(metric)), misses]))
    shortest = shortest[: len(metric)]
    # The first damping is a thousandth.
    assert np.linalg.norm(step - shortest) <= 0.02 * np.linalg.norm(shortest)
