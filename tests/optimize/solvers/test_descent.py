"""The Sobolev operator and a step to target probabilities against dense linear algebra; the line
search on functions with a known minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.optimize.coordinates import VertexCoordinates
from dicedesign.optimize.options import SobolevOptions
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker, LevenbergMarquardt
from dicedesign.optimize.solvers.descent import (
    LARGEST_MOVE,
    MEMORY,
    LineSearch,
    SobolevGradient,
    SobolevSolver,
    graph_laplacian,
)
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


DIRECTIONS = np.eye(3)


@dataclass
class Problem:
    """A function with its gradient, as an objective; None where it is undefined."""

    function: Callable[[np.ndarray], float | None]
    slope: Callable[[np.ndarray], np.ndarray]
    flaws: Callable[[np.ndarray], int] = lambda x: 0
    tried: list[np.ndarray] = field(default_factory=list)

    def at(self, parameters: np.ndarray) -> Point:
        value = self.function(parameters)
        assert value is not None
        return Point(self, parameters, value, DIRECTIONS)

    def attempt(self, parameters: np.ndarray, directions: np.ndarray) -> Point | None:
        self.tried.append(parameters)
        assert directions is DIRECTIONS
        if self.function(parameters) is None:
            return None
        return replace(self.at(parameters), flaws=self.flaws(parameters))


@dataclass
class Point:
    """The part of an evaluation that the search uses."""

    objective: Problem
    parameters: np.ndarray
    value: float
    directions: np.ndarray
    flaws: int = 0

    @property
    def gradient(self) -> np.ndarray:
        return self.objective.slope(self.parameters)


def test_steps_fall_below_the_worst_of_the_last_values_and_are_short() -> None:
    """On Rosenbrock's function."""
    problem = Problem(
        lambda x: float(100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2),
        lambda x: np.array(
            [
                -400.0 * x[0] * (x[1] - x[0] ** 2) - 2.0 * (1.0 - x[0]),
                200.0 * (x[1] - x[0] ** 2),
            ]
        ),
    )
    search, points = LineSearch(), [problem.at(np.array([-1.2, 1.0]))]
    while len(points) < 500:
        following = search.search(points[-1], points[-1].gradient)
        if following is None:
            break
        points.append(following)
    np.testing.assert_allclose(points[-1].parameters, 1.0, atol=1e-5)
    moves = np.diff([point.parameters for point in points], axis=0)
    assert np.abs(moves).max() == pytest.approx(LARGEST_MOVE)
    values = [point.value for point in points]
    assert (np.diff(values) > 0.0).any()
    for i in range(1, len(values)):
        assert values[i] < max(values[max(0, i - MEMORY) : i])


def test_a_direction_without_ascent_is_refused_untried() -> None:
    problem = Problem(lambda x: float(x @ x), lambda x: 2.0 * x)
    for ascent in (-1.0, 0.0, np.nan):
        assert LineSearch().search(problem.at(np.ones(1)), np.array([ascent])) is None
    assert problem.tried == []


def test_failed_trials_and_those_with_more_flaws_are_never_taken() -> None:
    """The function exists only for x > 0.995, and an outcome is lost below 0.999."""
    problem = Problem(lambda x: float(x @ x) if x[0] > 0.995 else None, lambda x: 2.0 * x)
    end = LineSearch().search(problem.at(np.array([1.0])), np.array([2.0]))
    assert end is not None
    assert 0.995 < end.parameters[0] < 1.0
    assert len(problem.tried) > 1
    assert all(x[0] <= 0.995 for x in problem.tried[:-1])

    flawed = Problem(lambda x: float(x[0]), lambda x: np.ones(1), lambda x: int(x[0] < 0.999))
    whole = flawed.at(np.ones(1))
    accepted = LineSearch().search(whole, np.ones(1))
    assert accepted is not None
    assert 0.999 <= accepted.parameters[0] < 1.0
    whole.flaws = 1
    moved = LineSearch().search(whole, np.ones(1))
    assert moved is not None
    assert moved.parameters[0] < 0.999
