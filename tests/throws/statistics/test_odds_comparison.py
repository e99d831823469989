"""Distances of predictions of a body with two opposite rests, where all of it has closed forms: the
Wasserstein distance is pi times the total variation, and that the difference of the first odds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dicedesign.throws import odds_comparison as module
from dicedesign.throws.distances import total_variation
from dicedesign.throws.odds_comparison import OddsComparison, Prediction, compare_odds

OPPOSITE = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])


def prediction(odds: float, drops: int | None = None) -> Prediction:
    return Prediction(np.array([odds, 1.0 - odds]), drops)


def compared(first: Prediction, second: Prediction, draws: int, seed: int = 0) -> OddsComparison:
    return compare_odds(OPPOSITE, first, second, draws, np.random.default_rng(seed))


@pytest.fixture
def quick_transport(monkeypatch: pytest.MonkeyPatch) -> None:
    """The closed form in place of the linear program, for thousands of draws."""
    monkeypatch.setattr(
        module, "wasserstein_distance", lambda _, p, __, q: math.pi * total_variation(p, q)
    )


def test_both_distances_are_of_the_same_draws() -> None:
    found = compared(prediction(0.9, 100), prediction(0.5, 400), 5)
    for part in ("value", "error", "noise_floor"):
        variation = getattr(found.total_variation, part)
        assert getattr(found.wasserstein, part) == pytest.approx(math.pi * variation, rel=1e-9)


def test_exact_odds_have_no_error_and_no_noise() -> None:
    found = compared(prediction(0.7), prediction(0.4), 2).total_variation
    assert (found.error, found.noise_floor) == (0.0, 0.0)
    assert found.value == pytest.approx(0.3, abs=1e-15)


@pytest.mark.usefixtures("quick_transport")
def test_counted_odds_scatter_about_themselves_and_noise_about_the_exact() -> None:
    for one, other in (
        (prediction(0.9, 400), prediction(0.5)),
        (prediction(0.5), prediction(0.9, 400)),
    ):
        found = compared(one, other, 2000).total_variation
        assert found.value == pytest.approx(0.4, abs=1e-15)
        assert found.error == pytest.approx(math.sqrt(0.9 * 0.1 / 400), rel=0.07)
        assert found.noise_floor == pytest.approx(math.sqrt(2 / math.pi * 0.25 / 400), rel=0.07)


@pytest.mark.usefixtures("quick_transport")
def test_of_two_counts_the_longer_one_says_more_about_the_odds() -> None:
    found = compared(prediction(0.9, 1000), prediction(0.5, 3000), 2000).total_variation
    assert found.error == pytest.approx(math.sqrt(0.09 / 1000 + 0.25 / 3000), rel=0.07)
    pooled = (0.9 * 1000 + 0.5 * 3000) / 4000
    normal = math.sqrt(2 / math.pi * pooled * (1 - pooled) * (1 / 1000 + 1 / 3000))
    assert found.noise_floor == pytest.approx(normal, rel=0.07)


@pytest.mark.usefixtures("quick_transport")
def test_the_squared_error_has_no_bias_however_few_the_draws() -> None:
    one, other = prediction(0.9, 400), prediction(0.5)
    errors = [compared(one, other, 2, seed).total_variation.error for seed in range(1000)]
    assert np.mean(np.square(errors)) == pytest.approx(0.9 * 0.1 / 400, rel=0.15)
