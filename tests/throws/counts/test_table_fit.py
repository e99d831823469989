"""Fitting throw parameters to counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from common.inline_executor import Inline
from common.kernels import compiled_only
from common.thrown import box, thrown
from scipy.special import expit

from dicedesign.errors import InputError
from dicedesign.throws.counts import table_fit as fitting
from dicedesign.throws.counts.table_fit import PARAMETERS, TableFit, fit_table
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.tables import Table

START = Table("mine", 0.5, 0.3, 0.5, 0.0, 0.0, source="counts")


def die(name: str, counts: Sequence[int], size: float | None = None) -> CountedDie:
    """A box whose three pairs of sides are two outcomes."""
    body, poses = thrown(box(1.0, 1.2, 1.4))
    shows = (np.abs(poses.normals).argmax(axis=1) > 0).astype(np.int64)
    even = np.array([0.5, 0.5])
    return CountedDie(name, body, size, ("a", "b"), np.array(counts), even, shows, poses)


def by_restitution(restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(5.0 * (restitution - 0.55)))


def by_friction(friction: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(4.0 * (friction + restitution - 1.0)))


def supposed(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> np.ndarray:
    """Counts from known odds in place of simulated ones."""
    if die.name == "first":
        p = by_restitution(np.array(table.restitution))
    else:
        p = by_friction(np.array(table.friction), np.array(table.restitution))
    came = np.random.default_rng(seed).binomial(drops, p)
    return np.array([came, drops - came])


DICE = (die("first", [160, 240]), die("second", [200, 300]))


@pytest.fixture(scope="module")
def fit() -> TableFit:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitting, "outcome_counts", supposed)
        return fit_table(DICE, START, 64, 2000, 1, workers=Inline())


def test_posterior_is_that_of_the_known_odds(fit: TableFit) -> None:
    """Against quadrature over the two parameters on which the odds depend."""
    axes = [np.linspace(*PARAMETERS[name], 401) for name in ("restitution", "friction")]
    e, mu = np.meshgrid(*axes, indexing="ij")
    p, q = by_restitution(e), by_friction(mu, e)
    likelihood = p**160 * (1 - p) ** 240 * (q**200 * (1 - q) ** 300) * 1e240
    weights = likelihood / likelihood.sum()
    for name, values in (("restitution", e), ("friction", mu)):
        mean = (weights * values).sum()
        deviation = np.sqrt((weights * (values - mean) ** 2).sum())
        found = fit.parameters[name]
        assert found.mean == pytest.approx(mean, abs=0.25 * deviation)
        assert found.deviation == pytest.approx(deviation, rel=0.2)
        order = np.argsort(values, axis=None)
        share = weights.ravel()[order].cumsum()
        limits = values.ravel()[order[np.searchsorted(share, [0.05, 0.95])]]
        assert found.interval == pytest.approx(limits, abs=0.5 * deviation)
        assert found.fitted == pytest.approx(mean, abs=deviation)
        assert found.limits == PARAMETERS[name]
    assert fit.correlations[0, 1] < -0.4
    assert fit.log_likelihood > -1.0


def test_what_the_counts_do_not_tell_keeps_its_prior(fit: TableFit) -> None:
    for name in ("height", "speed", "spin"):
        least, most = PARAMETERS[name]
        found = fit.parameters[name]
        assert found.deviation == pytest.approx((most - least) / np.sqrt(12.0), rel=0.15)
        assert found.mean == pytest.approx((least + most) / 2.0, abs=0.15 * (most - least))
        assert np.ptp(found.interval) == pytest.approx(0.9 * (most - least), rel=0.15)
    assert np.abs(fit.correlations[2:, :2]).max() < 0.25


def test_the_fit_says_how_it_was_made(fit: TableFit) -> None:
    assert (fit.evaluations, fit.drops) == (64, 2000)
    assert 0.7 < fit.surprise < 1.3
    assert fit.effective_points > 200
    fitted = {name: entry.fitted for name, entry in fit.parameters.items()}
    assert fit.table == replace(START, **fitted)
    assert all(value == float(f"{value:.3g}") for value in fitted.values())


def test_large_dice_fall_from_higher(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = []

    def seen(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> np.ndarray:
        tables.append(table)
        return supposed(die, table, drops, seed)

    monkeypatch.setattr(fitting, "outcome_counts", seen)
    large = (die("first", [160, 240], 0.3), DICE[1])
    told: list[int] = []
    found = fit_table(large, START, 32, 10, 0, workers=Inline(), progress=told.append)
    assert found.parameters["height"].limits == (0.3, 0.6)
    assert min(table.height for table in tables) >= 0.3
    assert told == [10] * 64


@compiled_only
def test_the_same_whatever_the_workers() -> None:
    """Every die at every set has drops of its own, told by the seed alone."""
    table = replace(START, restitution=0.2, friction=0.5, height=0.03)
    found = [fitting.outcome_counts(DICE[0], table, 40, (0, i, 0)).tolist() for i in (1, 2, 1)]
    assert found[0] == found[2] != found[1]
    assert sum(found[0]) == 40
    (own,) = np.random.SeedSequence((0, 1, 0)).generate_state(1).tolist()
    counts = simulate(DICE[0].body, table, 40, own).counts
    assert found[0] == [counts[DICE[0].group_of_rest == group].sum() for group in (0, 1)]


@pytest.mark.parametrize(
    ("effort", "message"),
    [
        ((31, 10, 0), "evaluations: expected a whole number of at least 32, got 31"),
        ((32, 0, 0), "drops: expected a whole number above 0, got 0"),
        ((32, 10, -1), "seed: expected a whole number of at least 0, got -1"),
    ],
)
def test_too_little_effort(effort: tuple[int, int, int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit_table(DICE, START, *effort, workers=Inline())
