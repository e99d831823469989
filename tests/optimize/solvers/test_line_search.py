"""The line search on functions whose minimum is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from dicedesign.optimize.solvers.descent import LARGEST_MOVE, MEMORY, LineSearch

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
