"""Weighted points against a posterior that is known."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.throws.importance import WeightedPoints, effective, weighted_points

CENTERS = np.array([[0.3, 0.6], [0.4, 0.5]])

SPREADS = np.array([[0.05, 0.1], [0.02, 0.3]])
"""Of two counts, whose likelihood is normal in each of two parameters."""


def normal(points: np.ndarray) -> np.ndarray:
    return np.stack(
        [
            -0.5 * (((points - c) / s) ** 2).sum(axis=1)
            for c, s in zip(CENTERS, SPREADS, strict=True)
        ],
        axis=1,
    )


@pytest.fixture(scope="module")
def found() -> WeightedPoints:
    return weighted_points(normal, 2, 2048, np.random.default_rng(1), leave_one_out=True)


@pytest.mark.parametrize("without", [None, 0, 1])
def test_moments(found: WeightedPoints, without: int | None) -> None:
    """Against quadrature, within the limits of the cube."""
    axis = (np.arange(1000) + 0.5) / 1000
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    kept = [i for i in (0, 1) if i != without]
    exact = np.exp(normal(grid)[:, kept].sum(axis=1))
    exact /= exact.sum()
    weights = found.weights(without)
    assert weights.sum() == pytest.approx(1.0)
    mean = exact @ grid
    deviation = np.sqrt(exact @ (grid - mean) ** 2)
    assert (np.abs(weights @ found.points - mean) < 0.1 * deviation).all()
    of_points = np.sqrt(weights @ (found.points - mean) ** 2)
    assert of_points == pytest.approx(deviation, rel=0.08)
    assert effective(weights) > 500


def test_a_posterior_at_the_border() -> None:
    """Of a likelihood that grows up to it."""
    found = weighted_points(
        lambda points: 40.0 * points[:, :1], 2, 2048, np.random.default_rng(2), leave_one_out=False
    )
    mean = found.weights() @ found.points
    assert mean == pytest.approx([1.0 - 1.0 / 40.0, 0.5], abs=0.02)
    assert effective(found.weights()) > 500


def test_equal_weights_are_all_effective() -> None:
    assert effective(np.full(7, 1.0 / 7.0)) == pytest.approx(7.0)


def test_a_posterior_that_is_narrow_beside_the_prior() -> None:
    """As of a million throws, of which the prior's points are too far off to have any weight."""
    center, deviation = np.array([0.3, 0.7, 0.5]), 1e-4

    def narrow(points: np.ndarray) -> np.ndarray:
        return -0.5 * np.square((points - center) / deviation).sum(axis=1, keepdims=True)

    found = weighted_points(narrow, 3, 1024, np.random.default_rng(3), leave_one_out=False)
    weights = found.weights()
    assert effective(weights) > 200
    mean = weights @ found.points
    assert mean == pytest.approx(center, abs=0.3 * deviation)
    spread = np.sqrt(weights @ (found.points - mean) ** 2)
    assert spread == pytest.approx(np.full(3, deviation), rel=0.2)
