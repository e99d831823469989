"""Transport on the sphere: closed forms, invariance, and another library."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import angle_between, unit_vectors
from dicedesign.throws import distances as module
from dicedesign.throws.distances import measure_transport, noise_floor, wasserstein_distance

X, Y, Z = np.eye(3)


def distribution(seed: int, count: int, spread: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Random directions and weights; a small spread makes most weights tiny."""
    rng = np.random.default_rng(seed)
    weights = np.maximum(rng.dirichlet(np.full(count, spread)), 10 ** rng.uniform(-14, -5, count))
    return unit_vectors(rng.normal(size=(count, 3))), weights / weights.sum()


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, np.pi / 2, 3.0, np.pi])
def test_one_direction_to_another(angle: float) -> None:
    turned = Rotation.from_rotvec([0, 0, angle]).apply(X)
    assert wasserstein_distance([X], [1.0], [turned], [1.0]) == pytest.approx(angle, rel=1e-12)


def test_one_direction_to_many_is_the_mean_angle() -> None:
    directions, weights = distribution(0, 12)
    mean = weights @ angle_between(Z, directions)
    assert wasserstein_distance([Z], [1.0], directions, weights) == pytest.approx(mean, abs=1e-9)
    assert wasserstein_distance(directions, weights, [Z], [1.0]) == pytest.approx(mean, abs=1e-9)


def test_two_directions_to_the_same_two() -> None:
    found = wasserstein_distance([X, Y], [0.75, 0.25], [Y, X], [0.6, 0.4])
    assert found == pytest.approx((0.75 - 0.4) * np.pi / 2, abs=1e-15)


def test_along_a_great_circle_it_is_the_distance_of_distribution_functions() -> None:
    """On an arc shorter than pi the problem is that on a line."""
    rng = np.random.default_rng(3)
    angles, weights = np.sort(rng.uniform(0, 3, 9)), rng.dirichlet(np.ones(9))
    other = rng.dirichlet(np.ones(9))
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(9)], axis=1)
    expected = np.abs(np.cumsum(weights - other))[:-1] @ np.diff(angles)
    found = wasserstein_distance(directions, weights, directions, other)
    assert found == pytest.approx(expected, abs=1e-9)


def test_the_same_distribution_in_another_order() -> None:
    directions, weights = distribution(1, 20)
    order = np.random.default_rng(2).permutation(20)
    assert wasserstein_distance(directions, weights, directions[order], weights[order]) < 1e-15


def test_turning_scaling_splitting_and_order_change_nothing() -> None:
    (a, p), (b, q) = distribution(4, 9), distribution(5, 7)
    turn = Rotation.random(random_state=6).as_matrix()
    expected = wasserstein_distance(a, p, b, q)
    halves = np.concatenate([p / 2, p / 2])
    for changed in (
        wasserstein_distance(b, q, a, p),
        wasserstein_distance(a @ turn.T, p, b @ turn.T, q),
        wasserstein_distance(a, 80 * p, b, 3 * q),
        wasserstein_distance(np.concatenate([a, a]), halves, b[::-1], q[::-1]),
        wasserstein_distance([*a, X], [*p, 0.0], b, q),
    ):
        assert changed == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("spread", [1.0, 0.03])
@pytest.mark.parametrize("count", [2, 11, 60])
def test_against_another_library(count: int, spread: float) -> None:
    ot = pytest.importorskip("ot")
    for seed in range(5):
        (a, p), (b, q) = distribution(seed, count, spread), distribution(99 + seed, count + 3)
        expected = ot.emd2(p, q, angle_between(a[:, None], b))
        assert wasserstein_distance(a, p, b, q) == pytest.approx(expected, abs=1e-8)
        # Both at the same rests.
        other = distribution(seed + 50, count, spread)[1]
        expected = ot.emd2(p, other, angle_between(a[:, None], a))
        assert wasserstein_distance(a, p, a, other) == pytest.approx(expected, abs=1e-8)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.lists(st.integers(1, 8), min_size=3, max_size=3))
def test_it_is_a_metric(seed: int, counts: list[int]) -> None:
    (a, p), (b, q), (c, r) = (distribution(seed + i, count) for i, count in enumerate(counts))
    there, onward = wasserstein_distance(a, p, b, q), wasserstein_distance(b, q, c, r)
    assert 0.0 <= there <= np.pi + 1e-9
    assert wasserstein_distance(a, p, c, r) <= there + onward + 1e-8


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([1.0], r"first_weights: expected 2, one for each direction"),
        ([1.0, -0.1], r"at least 0 that are not all 0, got a least of -0.1"),
        ([0.0, 0.0], r"not all 0"),
        ([np.nan, 1.0], r"finite numbers"),
        ([np.inf, 1.0], r"finite numbers"),
    ],
)
def test_weights_that_are_no_distribution(weights: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        wasserstein_distance([X, Y], weights, [Z], [1.0])


def test_no_direction() -> None:
    with pytest.raises(InputError, match="second_weights"):
        wasserstein_distance([X], [1.0], np.empty((0, 3)), [])


def test_between_two_rests_it_is_their_angle_times_the_total_variation() -> None:
    measured = measure_transport([X, Y], [60, 40], [0.5, 0.5], 0.95)
    assert measured.value == pytest.approx(0.1 * np.pi / 2)
    # The mean of 200 draws, within four standard errors.
    expected = noise_floor([0.5, 0.5], 100) * np.pi / 2
    assert measured.noise_floor == pytest.approx(expected, rel=4 * 0.76 / np.sqrt(200))
    low, high = measured.interval
    assert 0.0 <= low < measured.value < high
    # 1.96 standard errors of the frequency to either side.
    assert high - measured.value == pytest.approx(1.96 * 0.049 * np.pi / 2, rel=0.15)


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_the_interval_covers(off: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """In 20 series of throws; the standard error of a coverage of 0.95 is 0.05."""
    monkeypatch.setattr(module, "TRANSPORT_DRAWS", 20)
    directions, odds = distribution(7, 5)
    truth = (1 - off) * odds + off * np.eye(5)[0]
    expected = wasserstein_distance(directions, truth, directions, odds)
    drawn = np.random.default_rng(8).multinomial(300, truth, size=20)
    measured = [measure_transport(directions, counts, odds, 0.95) for counts in drawn]
    covered = [m.interval[0] <= expected <= m.interval[1] for m in measured]
    assert np.mean(covered) >= 0.85
