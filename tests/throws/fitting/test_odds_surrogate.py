"""Gaussian processes through simulated log odds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from dicedesign.throws.odds_surrogate import LEVEL, LogOddsProcess, OddsSurrogate


def curve(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(4.0 * points[:, 0]) + 0.5 * points[:, 1] ** 2)


@pytest.fixture(scope="module")
def process() -> LogOddsProcess:
    rng = np.random.default_rng(1)
    points = rng.random((120, 3))
    noise = rng.uniform(0.002, 0.02, 120)
    return LogOddsProcess(points, curve(points) + rng.normal(size=120) * np.sqrt(noise), noise)


def test_it_finds_the_curve_and_its_own_error(process: LogOddsProcess) -> None:
    points = np.random.default_rng(2).random((2000, 3))
    errors = process.means(points) - curve(points)
    deviations = np.sqrt(process.variances(points))
    assert np.abs(errors).mean() < 0.04
    assert 0.7 < np.sqrt(np.mean((errors / deviations) ** 2)) < 1.4
    assert 0.8 < np.sqrt(np.mean(process.surprises() ** 2)) < 1.2


def test_what_does_not_matter_has_a_long_length(process: LogOddsProcess) -> None:
    assert process.lengths[2] > 5.0 > process.lengths[0]


def test_prediction_is_the_conditional_distribution() -> None:
    """Against the joint normal distribution of observed and new values, inverted as a block."""
    rng = np.random.default_rng(3)
    points, new = rng.random((15, 2)), rng.random((4, 2))
    noise = rng.uniform(0.01, 0.1, 15)
    values = curve(points)
    process = LogOddsProcess(points, values, noise)
    both = np.vstack([points, new]) / process.lengths
    squares = ((both[:, None] - both[None]) ** 2).sum(-1)
    joint = process.variance * np.exp(-0.5 * squares) + LEVEL
    joint[:15, :15] += np.diag(noise + process.excess)
    precision = np.linalg.inv(joint)
    covariance = np.linalg.inv(precision[15:, 15:])
    means = process.mean - covariance @ precision[15:, :15] @ (values - process.mean)
    assert process.means(new) == pytest.approx(means, abs=1e-8)
    assert process.variances(new) == pytest.approx(np.diag(covariance), abs=1e-8)
    for i in range(15):
        rest = np.delete(np.arange(15), i)
        weights = np.linalg.solve(joint[np.ix_(rest, rest)], joint[rest, i])
        left = values[i] - process.mean - weights @ (values[rest] - process.mean)
        spread = joint[i, i] - weights @ joint[rest, i]
        assert process.surprises()[i] == pytest.approx(left / np.sqrt(spread), abs=1e-7)


@pytest.fixture(scope="module")
def surrogate() -> tuple[OddsSurrogate, np.ndarray]:
    """Of three outcomes whose odds depend on the first of two parameters."""
    rng = np.random.default_rng(4)
    points = rng.random((100, 2))
    counts = np.array([rng.multinomial(500, p) for p in true_odds(points)])
    return OddsSurrogate.through(points, counts), points


def true_odds(points: np.ndarray) -> np.ndarray:
    first = expit(2.0 * points[:, 0] - 2.0)
    second = (1.0 - first) * 0.3
    return np.stack([first, second, 1.0 - first - second], axis=1)


def test_odds(surrogate: tuple[OddsSurrogate, np.ndarray]) -> None:
    points = np.random.default_rng(5).random((300, 2))
    odds = surrogate[0].odds(points)
    assert odds.sum(axis=1) == pytest.approx(np.ones(300), abs=1e-14)
    assert np.abs(odds - true_odds(points)).max() < 0.03


def test_likelihood(surrogate: tuple[OddsSurrogate, np.ndarray]) -> None:
    """Against the multinomial formula, and its mean over draws of the odds."""
    points = np.array([[0.2, 0.5], [0.7, 0.9]])
    counts = np.array([30, 0, 50])
    of_odds = counts[[0, 2]] @ np.log(surrogate[0].odds(points)[:, [0, 2]].T)
    best = 30 * np.log(30 / 80) + 50 * np.log(50 / 80)
    plain = surrogate[0].log_likelihood(points, counts, False)
    assert plain == pytest.approx(of_odds - best, abs=1e-10)
    rng = np.random.default_rng(6)
    first, second = (
        expit(p.means(points) + np.sqrt(p.variances(points)) * rng.normal(size=(200_000, 2)))
        for p in surrogate[0].processes
    )
    drawn = first**30 * ((1.0 - first) * (1.0 - second)) ** 50
    exact = surrogate[0].log_likelihood(points, counts, True)
    assert exact == pytest.approx(np.log(drawn.mean(axis=0)) - best, abs=0.01)
