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
from dicedesign.throws import sessions as simulated
from dicedesign.throws.sessions import BETWEEN, PARAMETERS, SIZE
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_fit import TableFit, fit_table
from dicedesign.throws.tables import Table, least_of, mean_of
from dicedesign.throws.throw_counts import CountedDie

START = Table("mine", 0.0, 0.0, 0.0, 0.0, 0.0, source="counts")


def die(name: str, counts: Sequence[int], size: float | None = SIZE) -> CountedDie:
    """A box whose three pairs of sides are two outcomes."""
    body, poses = thrown(box(1.0, 1.2, 1.4))
    shows = (np.abs(poses.normals).argmax(axis=1) > 0).astype(np.int64)
    even = np.array([0.5, 0.5])
    return CountedDie(name, body, size, ("a", "b"), np.array(counts), even, shows, poses)


def by_restitution(restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(5.0 * (restitution - 0.55)))


def by_friction(friction: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(4.0 * (friction + restitution - 1.0)))


def by_height(height: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(5.0 * (restitution - 0.55) + 1.5 * np.log(height / 0.15)))


def supposed(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> np.ndarray:
    """Counts from known odds in place of simulated ones."""
    restitution = np.array(table.restitution)
    if die.name == "hand":
        p = by_height(np.array(mean_of(table.height)), restitution)
    elif die.name == "second":
        p = by_friction(np.array(table.friction), restitution)
    else:
        p = by_restitution(restitution)
    came = np.random.default_rng(seed).binomial(drops, p)
    return np.array([came, drops - came])


FIRST, SECOND = die("first", [160, 240]), die("second", [200, 300])


@pytest.fixture(autouse=True)
def known_odds(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "simulated" not in request.node.name:
        monkeypatch.setattr(simulated, "outcome_counts", supposed)


@pytest.fixture(scope="module")
def fit() -> TableFit:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulated, "outcome_counts", supposed)
        others = [die("same", [16, 24]), die("other", [35, 5])]
        return fit_table([FIRST, SECOND], START, 64, 2000, 1, others=others, workers=Inline())


def grid() -> tuple[np.ndarray, np.ndarray]:
    axes = [np.linspace(*PARAMETERS[name], 401) for name in ("restitution", "friction")]
    e, mu = np.meshgrid(*axes, indexing="ij")
    return e, mu


def likelihoods() -> tuple[np.ndarray, np.ndarray]:
    e, mu = grid()
    p, q = by_restitution(e), by_friction(mu, e)
    return p**160 * (1 - p) ** 240 * 1e110, q**200 * (1 - q) ** 300 * 1e140


def test_posterior_is_that_of_the_known_odds(fit: TableFit) -> None:
    """Against quadrature over the two parameters on which the odds depend."""
    e, mu = grid()
    first, second = likelihoods()
    weights = first * second / (first * second).sum()
    for name, values in (("restitution", e), ("friction", mu)):
        mean = (weights * values).sum()
        deviation = np.sqrt((weights * (values - mean) ** 2).sum())
        found = fit.parameters[name]
        assert found.mean == pytest.approx(mean, abs=0.25 * deviation)
        assert found.standard_deviation == pytest.approx(deviation, rel=0.2)
        order = np.argsort(values, axis=None)
        share = weights.ravel()[order].cumsum()
        limits = values.ravel()[order[np.searchsorted(share, [0.05, 0.95])]]
        assert found.interval == pytest.approx(limits, abs=0.5 * deviation)
        assert found.fitted == pytest.approx(mean, abs=deviation)
        assert found.searched == PARAMETERS[name]
    assert fit.correlations[0, 1] < -0.4
    assert fit.log_likelihood > -1.0


def test_what_the_counts_do_not_tell_keeps_its_prior(fit: TableFit) -> None:
    """Which is flat in the logarithm."""
    for name in ("height", "speed", "spin"):
        least, most = PARAMETERS[name]
        found, wide = fit.parameters[name], np.log(most / least)
        assert found.mean == pytest.approx((most - least) / wide, rel=0.15)
        ends = np.log(np.array(found.interval) / least) / wide
        assert ends == pytest.approx([0.05, 0.95], abs=0.06)
    assert np.abs(fit.correlations[2:, :2]).max() < 0.25


def test_each_die_is_predicted_without_its_own_counts(fit: TableFit) -> None:
    e, mu = grid()
    first, second = likelihoods()
    for number, weights, odds in (
        (0, second, by_restitution(e)),
        (1, first, by_friction(mu, e)),
        (2, first * second, by_restitution(e)),
    ):
        mean = (weights * odds).sum() / weights.sum()
        deviation = np.sqrt((weights * (odds - mean) ** 2).sum() / weights.sum())
        found = fit.dice[number].left_out
        assert found is not None
        assert found.odds[0] == pytest.approx(mean, abs=0.25 * deviation)
        assert found.deviation[0] == pytest.approx(deviation, rel=0.2)


def test_counts_that_go_with_the_others_and_some_that_do_not(fit: TableFit) -> None:
    same, other = fit.dice[2:]
    assert same.whole is None
    assert other.whole is None
    assert same.left_out is not None
    assert other.left_out is not None
    assert same.left_out.p_value > 0.3
    assert other.left_out.p_value < 0.001
    assert all(d.whole is not None and d.whole.p_value > 0.3 for d in fit.dice[:2])


def test_a_posterior_table_is_a_draw_of_the_posterior_and_of_a_session(fit: TableFit) -> None:
    assert len(fit.posterior) == 32
    for name in ("restitution", "friction"):
        values = np.array([getattr(table, name) for table in fit.posterior])
        parameter = fit.parameters[name]
        assert values.mean() == pytest.approx(
            parameter.mean, abs=0.4 * parameter.standard_deviation
        )
        assert values.std() == pytest.approx(parameter.standard_deviation, rel=0.35)
    assert all(least_of(table.height) >= 0.04 for table in fit.posterior)
    # Wider than the prior of the center by the sessions.
    speeds = np.log([mean_of(table.speed) for table in fit.posterior])
    least, most = PARAMETERS["speed"]
    wide = np.sqrt(np.log(most / least) ** 2 / 12.0 + BETWEEN**2)
    assert speeds.std() == pytest.approx(wide, rel=0.3)


def test_the_fit_says_how_it_was_made(fit: TableFit) -> None:
    assert (fit.evaluations, fit.drops) == (64, 2000)
    assert 0.7 < fit.surprise < 1.3
    assert fit.effective_points > 200
    table = fit.table
    for name in PARAMETERS:
        assert mean_of(getattr(table, name)) == pytest.approx(fit.parameters[name].fitted, rel=0.01)
    assert (table.name, table.source, table.size) == ("mine", "counts", SIZE)


def test_sessions_differ_in_hands() -> None:
    """Against quadrature over restitution, the center of heights, and a session about it."""
    found = fit_table([die("hand", [160, 240])], START, 64, 2000, 3, workers=Inline())
    e = np.linspace(*PARAMETERS["restitution"], 81)[:, None, None]
    center = np.geomspace(*PARAMETERS["height"], 81)[:, None]
    session = np.linspace(-4.0, 4.0, 81)
    p = by_height(center * np.exp(BETWEEN * session), e)
    likelihood = p**160 * (1 - p) ** 240 * 1e115
    weights = (likelihood * np.exp(-0.5 * session**2)).sum(axis=2)
    weights /= weights.sum()
    for name, values in (("restitution", e[..., 0]), ("height", center.T)):
        mean = (weights * values).sum()
        deviation = np.sqrt((weights * (values - mean) ** 2).sum())
        assert found.parameters[name].mean == pytest.approx(mean, abs=0.25 * deviation)
        assert found.parameters[name].standard_deviation == pytest.approx(deviation, rel=0.2)


def test_counts_that_no_table_explains() -> None:
    """The odds of the first outcome are at least 0.095 within the limits."""
    found = fit_table([die("first", [4, 396]), SECOND], START, 32, 2000, 0, workers=Inline())
    first, second = found.dice
    assert first.whole is not None
    assert second.whole is not None
    assert first.whole.p_value < 0.001
    low, high = first.whole.interval
    assert 4 < low < high
    assert second.whole.p_value > 0.01


def test_what_is_told_of_more_throws(fit: TableFit) -> None:
    """By the inverse of Fisher's information, of a die whose odds tell restitution alone."""
    of_first = fit.dice[2]
    slope = 5.0 * 0.25 * 0.96
    before = fit.parameters["restitution"].standard_deviation
    wanted = [(before**-2 + count * slope**2 / 0.24) ** -0.5 for count in (50, 200, 800)]
    assert of_first.after[[0, 2, 4], 0] == pytest.approx(wanted, rel=0.1)


@compiled_only
def test_simulated_counts_are_the_same_whatever_the_workers() -> None:
    """Every die at every set has drops of its own, told by the seed alone."""
    table = Table("mine", 0.2, 0.5, 0.03, 0.0, 0.0)
    found = [simulated.outcome_counts(FIRST, table, 40, (0, i, 0)).tolist() for i in (1, 2, 1)]
    assert found[0] == found[2] != found[1]
    assert sum(found[0]) == 40
    (own,) = np.random.SeedSequence((0, 1, 0)).generate_state(1).tolist()
    counts = simulate(FIRST.body, table, 40, own).counts
    assert found[0] == [counts[FIRST.group_of_rest == group].sum() for group in (0, 1)]


def test_progress_tells_each_die_at_each_set() -> None:
    told: list[int] = []
    others = [replace(FIRST, counts=np.array([0, 0]))]
    found = fit_table(
        [SECOND], START, 32, 10, 0, others=others, workers=Inline(), progress=told.append
    )
    assert told == [10] * 64
    assert (found.dice[1].whole, found.dice[1].left_out) == (None, None)


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
        fit_table([FIRST], START, *effort, workers=Inline())
