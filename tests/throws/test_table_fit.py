"""Fits of tables to counts, and predictions, against posteriors by quadrature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from common.inline_executor import Inline
from common.kernels import compiled_only
from common.paths import public_data
from common.thrown import box, random_body, rigid_body_with_rests
from scipy import stats
from scipy.special import expit, xlogy

from dicedesign.throws import sessions as simulated
from dicedesign.throws import table_fit
from dicedesign.throws.distances import jeffreys_means
from dicedesign.throws.goodness_of_fit import (
    SERIES,
    chi_square,
    predict,
    two_sample_chi_square,
)
from dicedesign.throws.probability_surrogate import (
    LEVEL,
    LogProbabilityProcess,
    ProbabilitySurrogate,
    effective,
    sample_posterior,
)
from dicedesign.throws.sessions import HANDS, SIZE, SURFACES, Prior, outcome_counts
from dicedesign.throws.simulation import simulate
from dicedesign.throws.table_fit import TableFit, check_die, fit_table, scatter_probabilities
from dicedesign.throws.tables import Table, least_of, mixture_tables
from dicedesign.throws.throw_counts import CountedDie, read_throw_counts


def test_a_posterior_much_narrower_than_the_prior() -> None:
    """As after a million throws; no point of the prior has any weight."""
    center, deviation = np.array([0.3, 0.7, 0.5]), 1e-4

    def narrow(points: np.ndarray) -> np.ndarray:
        return -0.5 * np.square((points - center) / deviation).sum(axis=1, keepdims=True)

    posterior = sample_posterior(narrow, 3, 1024, np.random.default_rng(3), leave_one_out=False)
    weights = posterior.weights()
    assert effective(weights) > 200
    mean = weights @ posterior.points
    assert mean == pytest.approx(center, abs=0.3 * deviation)
    spread = np.sqrt(weights @ (posterior.points - mean) ** 2)
    assert spread == pytest.approx(np.full(3, deviation), rel=0.2)


def curve(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(4.0 * points[:, 0]) + 0.5 * points[:, 1] ** 2)


def test_prediction_is_the_conditional_distribution() -> None:
    """Against the joint normal distribution of observed and new values."""
    rng = np.random.default_rng(3)
    points, new = rng.random((15, 2)), rng.random((4, 2))
    noise = rng.uniform(0.01, 0.1, 15)
    values = curve(points)
    process = LogProbabilityProcess(points, values, noise)
    both = np.vstack([points, new]) / process.lengths
    squares = ((both[:, None] - both[None]) ** 2).sum(-1)
    joint = process.variance * np.exp(-0.5 * squares) + LEVEL
    joint[:15, :15] += np.diag(noise + process.excess)
    precision = np.linalg.inv(joint)
    covariance = np.linalg.inv(precision[15:, 15:])
    means = process.mean - covariance @ precision[15:, :15] @ (values - process.mean)
    assert process.means(new) == pytest.approx(means, abs=1e-8)
    assert process.variances(new) == pytest.approx(np.diag(covariance), abs=1e-8)


def true_probabilities(points: np.ndarray) -> np.ndarray:
    """Of three outcomes, by the first of two parameters."""
    first = expit(2.0 * points[:, 0] - 2.0)
    second = (1.0 - first) * 0.3
    return np.stack([first, second, 1.0 - first - second], axis=1)


START = Table("mine", 0.0, 0.0, 0.0, 0.0, 0.0, source="counts")


@compiled_only
def test_throws_scale_with_the_size_of_the_die() -> None:
    """To the last bit: a factor of four in length is one of two in time and speed."""
    body, _ = random_body(2)
    table = Table("small", 0.5, 0.4, (0.03, 0.1), (0.1, 0.4), (10.0, 40.0), size=0.025)
    large = Table("large", 0.5, 0.4, (0.12, 0.4), (0.2, 0.8), (5.0, 20.0), size=0.1)
    both = [simulate(body, sized, 200, seed=3).outcomes.tolist() for sized in (table, large)]
    assert both[0] == both[1]


def die(name: str, counts: Sequence[int], size: float | None = SIZE) -> CountedDie:
    """Box with two outcomes."""
    body, poses = rigid_body_with_rests(box(1.0, 1.2, 1.4))
    shows = (np.abs(poses.normals).argmax(axis=1) > 0).astype(np.int64)
    even = np.array([0.5, 0.5])
    return CountedDie(name, body, size, ("a", "b"), np.array(counts), even, shows, poses)


def surrogate_of_three(counts: Sequence[int]) -> ProbabilitySurrogate:
    """Surrogate of a die with three outcomes of `true_probabilities`, and some counts."""
    rng = np.random.default_rng(4)
    sets = rng.random((100, 2))
    came = np.array([rng.multinomial(500, p) for p in true_probabilities(sets)])
    return ProbabilitySurrogate.through(
        replace(die("three", [0, 0]), counts=np.array(counts)), sets, came
    )


POINTS = np.array([[0.2, 0.5], [0.7, 0.9]])


@pytest.mark.parametrize("concentration", [8.0, 300.0, 1e5])
def test_likelihood_is_dirichlet_multinomial(concentration: float) -> None:
    """Against SciPy's, and its mean over draws of the probabilities."""
    counts = np.array([30, 0, 50])
    surrogate = surrogate_of_three(counts)
    reference = stats.dirichlet_multinomial.logpmf
    orders = stats.multinomial.logpmf(counts, 80, counts / 80)
    each = np.full(2, concentration)
    wanted = [reference(counts, concentration * p, 80) for p in surrogate.probabilities(POINTS)]
    plain = surrogate.log_likelihood(POINTS, each, False)
    assert plain == pytest.approx(np.array(wanted) - orders, abs=1e-7)
    rng = np.random.default_rng(6)
    for point, got in zip(POINTS, surrogate.log_likelihood(POINTS, each, True), strict=True):
        drawn = surrogate.probabilities(np.tile(point, (40_000, 1)), rng)
        mean = np.exp(reference(counts, concentration * drawn, 80)).mean()
        assert got == pytest.approx(np.log(mean) - orders, abs=0.02)


def test_scattered_probabilities() -> None:
    """Their counts are Dirichlet-multinomial."""
    rng = np.random.default_rng(5)
    means = np.tile([0.2, 0.8], (40_000, 1))
    drawn = scatter_probabilities(means, np.full(len(means), 20.0), rng)
    assert drawn.sum(axis=1) == pytest.approx(np.ones(len(means)))
    came = np.bincount(rng.binomial(6, drawn[:, 0]), minlength=7) / len(means)
    assert came == pytest.approx(stats.betabinom.pmf(np.arange(7), 6, 4.0, 16.0), abs=0.01)


def by_restitution(restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(5.0 * (restitution - 0.55)))


def by_friction(friction: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(4.0 * (friction + restitution - 1.0)))


def by_height(height: np.ndarray, restitution: np.ndarray) -> np.ndarray:
    return np.asarray(expit(5.0 * (restitution - 0.55) + 1.5 * np.log(height / 0.15)))


def simulate_known(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> np.ndarray:
    """Counts from known probabilities instead of simulated ones."""
    restitution = np.array(table.restitution)
    if die.name.startswith("hand"):
        p = by_height(np.mean(table.height), restitution)
    elif die.name == "second":
        p = by_friction(np.array(table.friction), restitution)
    else:
        p = by_restitution(restitution)
    came = np.random.default_rng(seed).binomial(drops, p)
    return np.array([came, drops - came])


FIRST, SECOND = die("first", [160, 240]), die("second", [200, 300])


@pytest.fixture(autouse=True)
def known_probabilities(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "simulated" not in request.node.name:
        monkeypatch.setattr(simulated, "outcome_counts", simulate_known)


@pytest.fixture(scope="module")
def fit() -> TableFit:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulated, "outcome_counts", simulate_known)
        others = [die("same", [16, 24]), die("other", [35, 5])]
        return fit_table([FIRST, SECOND], START, 64, 2000, 1, others=others, workers=Inline())


def grid() -> tuple[np.ndarray, np.ndarray]:
    axes = [np.linspace(*SURFACES[name], 201) for name in ("restitution", "friction")]
    e, mu = np.meshgrid(*axes, indexing="ij")
    return e, mu


SCATTERS = np.geomspace(*HANDS["scatter"], 25)


def by_scatter(p: np.ndarray, count: int, throws: int) -> np.ndarray:
    """Likelihoods (s, ...) of a count at probabilities (...), for each of `SCATTERS`."""
    concentration = 1.0 / SCATTERS.reshape(-1, *[1] * p.ndim) - 1.0
    return stats.betabinom.pmf(count, throws, concentration * p, concentration * (1.0 - p))


def likelihoods() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the first die's counts, the second's, and both, for each of `SCATTERS`."""
    e, mu = grid()
    first = by_scatter(by_restitution(e), 160, 400)
    second = by_scatter(by_friction(mu, e), 200, 500)
    return first, second, first * second


def test_the_posterior_of_known_probabilities(fit: TableFit) -> None:
    """Against quadrature over the two parameters on which the probabilities depend."""
    e, mu = grid()
    _, _, both = likelihoods()
    weights = both.sum(axis=0) / both.sum()
    for name, values in (("restitution", e), ("friction", mu)):
        mean = (weights * values).sum()
        deviation = np.sqrt((weights * (values - mean) ** 2).sum())
        parameter = fit.parameters[name]
        assert parameter.mean == pytest.approx(mean, abs=0.25 * deviation)
        assert parameter.standard_deviation == pytest.approx(deviation, rel=0.2)
        order = np.argsort(values, axis=None)
        share = weights.ravel()[order].cumsum()
        limits = values.ravel()[order[np.searchsorted(share, [0.05, 0.95])]]
        assert parameter.interval == pytest.approx(limits, abs=0.5 * deviation)
        assert parameter.fitted == pytest.approx(mean, abs=deviation)
        assert parameter.searched == SURFACES[name]
        assert parameter.prior_deviation == pytest.approx(np.ptp(values) / 12**0.5, rel=1e-3)
    assert fit.correlations[0, 1] < -0.4
    assert fit.log_likelihood > -1.0


def test_each_die_is_predicted_without_its_own_counts(fit: TableFit) -> None:
    e, mu = grid()
    first, second, both = likelihoods()
    for number, weights, probabilities in (
        (0, second, by_restitution(e)),
        (1, first, by_friction(mu, e)),
        (2, both, by_restitution(e)),
    ):
        weights = weights / weights.sum()
        mean = (weights * probabilities).sum()
        scattered = SCATTERS[:, None, None] * probabilities * (1.0 - probabilities)
        deviation = np.sqrt((weights * ((probabilities - mean) ** 2 + scattered)).sum())
        prediction = fit.dice[number].left_out
        assert prediction is not None
        assert prediction.probabilities[0] == pytest.approx(mean, abs=0.25 * deviation)
        assert prediction.deviation[0] == pytest.approx(deviation, rel=0.2)


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
    speeds = np.log([np.mean(table.speed) for table in fit.posterior])
    (least, most), between = HANDS["speed"], np.geomspace(*HANDS["between"], 99)
    wide = np.sqrt(np.log(most / least) ** 2 / 12.0 + np.square(between).mean())
    assert speeds.std() == pytest.approx(wide, rel=0.3)


@pytest.mark.parametrize("session", [None, "evening"])
def test_dice_of_one_session_share_its_hand(session: str | None) -> None:
    """Against quadrature over restitution, the center of heights, the spread of sessions, and the
    session of each die."""
    dice = [replace(die("hand", counts), session=session) for counts in ([160, 240], [120, 180])]
    dice[1] = replace(dice[1], name="hand 2")
    refit = fit_table(dice, START, 64, 2000, 3, workers=Inline())
    e = np.linspace(*SURFACES["restitution"], 31)[:, None, None, None]
    center = np.geomspace(*HANDS["height"], 31)[:, None, None]
    between = np.geomspace(*HANDS["between"], 7)[:, None]
    z = np.linspace(-4.0, 4.0, 41)
    p = by_height(SIZE * center * np.exp(between * z), e)
    at = np.linspace(1e-3, 1.0 - 1e-3, 999)
    first, second = by_scatter(at, 160, 400), by_scatter(at, 120, 300)
    normal = np.exp(-0.5 * z**2)
    weights = np.zeros(p.shape[:3])
    for one, other in zip(first, second, strict=True):
        one, other = np.interp(p, at, one), np.interp(p, at, other)
        if session is None:
            weights += (one @ normal) * (other @ normal) / normal.sum()
        else:
            weights += (one * other) @ normal
    weights /= weights.sum()
    for name, values in (
        ("restitution", e[..., 0]),
        ("height", center[..., 0]),
        ("between", between[..., 0]),
    ):
        mean = (weights * values).sum()
        deviation = np.sqrt((weights * (values - mean) ** 2).sum())
        assert refit.parameters[name].mean == pytest.approx(mean, abs=0.25 * deviation)
        assert refit.parameters[name].standard_deviation == pytest.approx(deviation, rel=0.2)
    assert [one.name for one in refit.sessions] == (
        ["hand", "hand 2"] if session is None else [session]
    )
    for one in refit.sessions:
        assert (np.diff(one.quantiles, axis=0) > 0.0).all()
        assert one.typical[0] == pytest.approx(SIZE * one.quantiles[1, 0])
        heights = [np.mean(table.height) / SIZE for table in one.tables]
        # Tables are for dice of up to 40 mm.
        assert min(heights) == pytest.approx(3.2)
        assert np.quantile(heights, [0.5, 0.95]) == pytest.approx(one.quantiles[1:, 0], rel=0.4)


def test_known_parameters_of_many_dice_are_recovered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two materials and of the scatter, from throws with known probabilities."""
    monkeypatch.setattr(table_fit, "PILOT", (2**9, 2))
    monkeypatch.setattr(table_fit, "FINAL", (2**9, 2))
    rng = np.random.default_rng(8)
    true = {"restitution of steel": 0.4, "restitution of plastic": 0.7, "scatter": 0.004}
    dice = []
    for material in ("steel", "plastic"):
        p = by_restitution(np.array(true[f"restitution of {material}"]))
        means, concentration = np.array([[p, 1.0 - p]]), np.array([1.0 / true["scatter"] - 1.0])
        for i in range(6):
            counts = rng.multinomial(1000, scatter_probabilities(means, concentration, rng)[0])
            dice.append(replace(die(f"{material} {i}", counts.tolist()), material=material))
    refit = fit_table(dice, START, 32, 2000, 3, workers=Inline())
    for name, value in true.items():
        parameter = refit.parameters[name]
        low, high = parameter.interval
        assert low < value < high
        assert parameter.standard_deviation < 0.8 * parameter.prior_deviation
    assert list(refit.tables) == ["steel", "plastic"]
    for material, table in refit.tables.items():
        assert table.restitution == refit.parameters[f"restitution of {material}"].fitted
    steel = refit.parameters["restitution of steel"]
    drawn = np.mean([table.restitution for table in refit.posterior])
    assert drawn == pytest.approx(steel.mean, abs=steel.standard_deviation)


def test_similar_throws_in_units_of_the_die() -> None:
    """A session is equal for all its dice, and its spread is that of its logarithms."""
    prior = Prior(("wood", "steel"))
    assert list(prior.limits)[:4] == [
        "restitution of wood",
        "friction of wood",
        "restitution of steel",
        "friction of steel",
    ]
    points = np.full(9, 0.5)
    e, mu, height, speed, spin = prior.session_values(points, np.array([1.0, 0.0, -1.0]), "steel")
    between = np.sqrt(np.prod(HANDS["between"]))
    assert (e, mu) == pytest.approx((0.5, 0.625))
    assert height == pytest.approx(np.sqrt(50.0) * np.exp(between))
    assert speed == pytest.approx(np.sqrt(1.5))
    assert spin == pytest.approx(np.sqrt(1.25) * np.exp(-between))
    (scatter,) = 1.0 / (1.0 + prior.concentration(points[None]))
    assert scatter == pytest.approx(np.sqrt(2e-7))


def test_prediction_with_known_probabilities_is_the_likelihood_ratio_test() -> None:
    """Against all possible counts."""
    throws, p = 30, 0.3
    every = np.arange(throws + 1)
    counts = np.stack([every, throws - every], axis=1)
    ratio = 2.0 * (xlogy(counts, counts / throws) - counts * np.log([p, 1.0 - p])).sum(axis=1)
    for came in (4, 9, 15):
        exact = stats.binom.pmf(every[ratio >= ratio[came] - 1e-9], throws, p).sum()
        prediction = predict(counts[came], np.array([[p, 1.0 - p]]), np.random.default_rng(came))
        assert prediction.p_value == pytest.approx(
            exact, abs=4.0 * prediction.standard_error + 1e-3
        )
        assert prediction.probabilities == pytest.approx([p, 1.0 - p])
        assert prediction.deviation == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_outcome_farthest_from_the_prediction() -> None:
    probabilities = np.tile([0.1, 0.3, 0.6], (50, 1))
    prediction = predict(np.array([60, 90, 150]), probabilities, np.random.default_rng(4))
    assert prediction.worst == 0
    low, high = prediction.interval
    assert [low, high] == pytest.approx(stats.binom.ppf([0.025, 0.975], 300, 0.1), abs=1)
    assert prediction.p_value == pytest.approx(1.0 / (SERIES + 1))


DEAD = Table("dead", 0.0, 0.5, 0.03, 0.0, 0.0)


@compiled_only
def test_a_die_thrown_on_the_same_table() -> None:
    """Box that was dropped without a bounce, with one side of no outcome."""
    body, poses = rigid_body_with_rests(box(1.0, 1.2, 1.4))
    sides = np.abs(poses.normals).argmax(axis=1)
    groups = np.where(poses.normals[:, 2] > 0.5, -1, sides)
    counts_of_facets = simulate(body, DEAD, 600, seed=1).counts
    real = np.array([counts_of_facets[groups == side].sum() for side in range(3)])
    probabilities = np.array([0.1, 0.2, 0.7])
    die = CountedDie("box", body, None, ("x", "y", "z"), real, probabilities, groups, poses)
    progress: list[int] = []
    check = check_die(die, DEAD, 700, 2, progress=progress.append)
    assert sum(progress) == 700
    assert check.unresolved == 0
    same = simulate(body, DEAD, 700, seed=2).counts
    wanted = [same[groups == side].sum() for side in range(3)]
    assert check.simulated.tolist() == wanted
    assert check.probabilities.sum() == pytest.approx(1.0)
    assert check.chi_square == two_sample_chi_square(real, wanted)
    assert check.chi_square.p_value > 0.01
    assert check.exact.p_value > 0.005
    assert check.geometric == chi_square(real, [0.1, 0.2, 0.7])
    assert check.geometric.p_value < 1e-9


@compiled_only
def test_published_dice_are_consistent_with_board_game() -> None:
    """And two of them not with the probabilities without momentum."""
    throws = public_data("published/throws.csv")
    names = ["binomial2", "binomial3", "binomial4", "2d6_hendecahedron"]
    tables, is_known = mixture_tables("board-game"), []
    for die in read_throw_counts(throws, names):
        # Each session has one table of the mixture.
        counts = [outcome_counts(die, table, 1000, (12, k)) for k, table in enumerate(tables)]
        probabilities = np.array([jeffreys_means(one) for one in counts])
        assert predict(die.counts, probabilities, np.random.default_rng(0)).p_value > 0.01
        is_known.append(chi_square(die.counts, die.geometric).p_value > 0.01)
    assert is_known == [True, True, False, False]
