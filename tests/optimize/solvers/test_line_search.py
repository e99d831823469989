"""The line search on functions whose minimum is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from dicedesign.optimize.solvers.descent import LARGEST_MOVE, LARGEST_STEP, MEMORY, LineSearch

DIRECTIONS = np.eye(3)


@dataclass
class Problem:
    """A function with its gradient, in the place of an objective; None where it is undefined."""

    function: Callable[[np.ndarray], float | None]
    slope: Callable[[np.ndarray], np.ndarray]
    tried: list[np.ndarray] = field(default_factory=list)

    def at(self, parameters: np.ndarray) -> Point:
        value = self.function(parameters)
        assert value is not None
        return Point(self, parameters, value, DIRECTIONS)

    def attempt(self, parameters: np.ndarray, directions: np.ndarray) -> Point | None:
        self.tried.append(parameters)
        assert directions is DIRECTIONS
        value = self.function(parameters)
        return None if value is None else Point(self, parameters, value, directions)


@dataclass
class Point:
    """What the search needs of an evaluation."""

    objective: Problem
    parameters: np.ndarray
    value: float
    directions: np.ndarray
    flaws: int = 0

    @property
    def gradient(self) -> np.ndarray:
        return self.objective.slope(self.parameters)


def quadratic(curvatures: list[float]) -> Problem:
    diagonal = np.array(curvatures)
    return Problem(lambda x: float(0.5 * diagonal @ x**2), lambda x: diagonal * x)


def minimised(problem: Problem, point: Point, steps: int, metric: np.ndarray | float = 1.0):
    search = LineSearch()
    values = [point.value]
    for _ in range(steps):
        following = search.search(point, metric * point.gradient)
        if following is None:
            break
        point = following
        values.append(point.value)
    return point, values, search


@pytest.mark.parametrize("curvatures", [[1.0, 1.0], [1.0, 10.0, 100.0], [0.5, 7.0, 400.0, 2000.0]])
def test_a_quadratic_converges(curvatures: list[float]) -> None:
    problem = quadratic(curvatures)
    end, values, search = minimised(problem, problem.at(np.ones(len(curvatures))), 300)
    assert np.abs(end.parameters).max() < 1e-7
    assert values[-1] < 1e-14 * values[0]
    assert search.evaluations == len(problem.tried)


def test_steps_fall_below_the_worst_of_the_last_values() -> None:
    problem = Problem(
        lambda x: float(100.0 * (x[1] - x[0] ** 2) ** 2 + (1.0 - x[0]) ** 2),
        lambda x: np.array(
            [
                -400.0 * x[0] * (x[1] - x[0] ** 2) - 2.0 * (1.0 - x[0]),
                200.0 * (x[1] - x[0] ** 2),
            ]
        ),
    )
    end, values, _ = minimised(problem, problem.at(np.array([-1.2, 1.0])), 500)
    np.testing.assert_allclose(end.parameters, 1.0, atol=1e-5)
    assert (np.diff(values) > 0.0).any()
    for i in range(1, len(values)):
        assert values[i] < max(values[max(0, i - MEMORY) : i])


@pytest.mark.parametrize(
    "ascent",
    [[-1.0, 0.0], [0.0, 0.0], [np.nan, 1.0]],
)
def test_a_direction_without_ascent_is_refused_untried(ascent: list[float]) -> None:
    problem = quadratic([1.0, 1.0])
    search = LineSearch()
    assert search.search(problem.at(np.array([1.0, 0.0])), np.array(ascent)) is None
    assert problem.tried == []
    assert search.evaluations == 0


def test_failed_trials_are_never_taken() -> None:
    """The function exists only for x > 0.995: the first trials fall outside."""
    problem = Problem(lambda x: float(x @ x) if x[0] > 0.995 else None, lambda x: 2.0 * x)
    search = LineSearch()
    end = search.search(problem.at(np.array([1.0])), np.array([2.0]))
    assert end is not None
    assert 0.995 < end.parameters[0] < 1.0
    assert search.evaluations == len(problem.tried) > 1
    assert all(x[0] <= 0.995 for x in problem.tried[:-1])


def test_no_step_is_found_where_every_trial_fails() -> None:
    problem = Problem(lambda x: 1.0 if x[0] == 1.0 else None, lambda x: np.ones(1))
    assert LineSearch().search(problem.at(np.ones(1)), np.ones(1)) is None
    assert len(problem.tried) < 60


def test_a_wrong_gradient_finds_no_step() -> None:
    problem = Problem(lambda x: float(x[0]), lambda x: -np.ones(1))
    assert LineSearch().search(problem.at(np.zeros(1)), -np.ones(1)) is None


@pytest.mark.parametrize(
    ("steepness", "furthest"), [(1e-3, LARGEST_STEP * 1e-3), (1.0, LARGEST_MOVE)]
)
def test_steps_along_a_straight_slope_grow_to_a_limit(steepness: float, furthest: float) -> None:
    problem = Problem(lambda x: float(steepness * x[0]), lambda x: np.full(1, steepness))
    end, values, _ = minimised(problem, problem.at(np.zeros(1)), 40)
    moves = -np.diff(values) / steepness
    assert end.value == values[-1]
    assert moves.min() > 0.0
    assert moves.max() == pytest.approx(furthest)


def test_a_trial_with_more_flaws_is_not_taken() -> None:
    """Lower, but an outcome is lost beyond 0.999."""

    @dataclass
    class Flawed(Problem):
        def attempt(self, parameters: np.ndarray, directions: np.ndarray) -> Point | None:
            point = super().attempt(parameters, directions)
            assert point is not None
            point.flaws = int(parameters[0] < 0.999)
            return point

    problem = Flawed(lambda x: float(x[0]), lambda x: np.ones(1))
    whole = problem.at(np.ones(1))
    kept = LineSearch().search(whole, np.ones(1))
    assert kept is not None
    assert 0.999 <= kept.parameters[0] < 1.0
    whole.flaws = 1
    moved = LineSearch().search(whole, np.ones(1))
    assert moved is not None
    assert moved.parameters[0] < 0.999


def test_after_a_restart_old_high_values_excuse_nothing() -> None:
    """A rise that the memory would allow is refused once the memory is gone."""
    rising = Problem(lambda x: 1.0 if x[0] == 0.0 else 2.0, lambda x: np.ones(1))
    remembering, restarted = LineSearch(), LineSearch()
    high = Problem(lambda x: 5.0 if x[0] == 0.0 else 4.0, lambda x: np.ones(1)).at(np.zeros(1))
    for search in (remembering, restarted):
        assert search.search(high, np.ones(1)) is not None
    restarted.restart()
    assert remembering.search(rising.at(np.zeros(1)), np.ones(1)) is not None
    assert restarted.search(rising.at(np.zeros(1)), np.ones(1)) is None
