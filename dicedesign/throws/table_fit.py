"""Tables fitted to counts of several real dice, thrown in one or several sessions, and their
predictions for dice; `sessions` states the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import logsumexp
from scipy.stats import qmc

from dicedesign.errors import MOST_SEED, check_whole, printable
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.throws.distances import jeffreys_means
from dicedesign.throws.goodness_of_fit import (
    ChiSquareTest,
    MultinomialTest,
    Prediction,
    chi_square,
    exact_multinomial,
    predict,
    two_sample_chi_square,
)
from dicedesign.throws.probability_surrogate import (
    ProbabilitySurrogate,
    WeightedPoints,
    effective,
    log_likelihoods,
    sample_posterior,
)
from dicedesign.throws.sessions import (
    LOWEST,
    SIMULATED,
    SIZE,
    UNITS,
    Offsets,
    Prior,
    round_value,
    session_offsets,
    set_counts,
    simulated_values,
    table_of,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import SPREADS, Table
from dicedesign.throws.throw_counts import CountedDie


@dataclass(frozen=True)
class DieCheck:
    """Comparison of real and simulated throws of one die.

    Attributes
    ----------
    die: the die with its real counts.
    simulated: (g,) simulated counts.
    unresolved: number of simulated drops without a rest.
    chi_square: two-sample test of real and simulated counts.
    exact: exact test of the real counts against the simulated probabilities, taken as known.
    geometric: test of the real counts against the probabilities without momentum.
    """

    die: CountedDie
    simulated: Integers
    unresolved: int
    chi_square: ChiSquareTest
    exact: MultinomialTest
    geometric: ChiSquareTest

    @property
    def probabilities(self) -> Floats:
        """(g,) simulated probabilities, above 0, under Jeffreys' prior."""
        return jeffreys_means(self.simulated)


def check_die(
    die: CountedDie,
    table: Table,
    drops: int,
    seed: int,
    *,
    workers: Executor | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> DieCheck:
    """Simulate throws of a die on a table, and compare them with its counts.

    Parameters and errors are as in `simulate`. The die has the table's size: throws are in units of
    the die.
    """
    throws = simulate(die.body, table, drops, seed, workers=workers, progress=progress)
    simulated = die.by_outcome(throws.counts)
    return DieCheck(
        die=die,
        simulated=simulated,
        unresolved=throws.unresolved,
        chi_square=two_sample_chi_square(die.counts, simulated),
        exact=exact_multinomial(die.counts, jeffreys_means(simulated)),
        geometric=chi_square(die.counts, die.geometric),
    )


CREDIBLE_LEVEL: Final = 0.9
"""Posterior probability of the interval of each parameter."""


@dataclass(frozen=True)
class FittedParameter:
    """Posterior of one parameter of `Prior`.

    Attributes
    ----------
    fitted: value in the fitted set.
    mean, standard_deviation: of the posterior.
    interval: equal-tailed credible interval of the level `CREDIBLE_LEVEL`.
    searched, prior_deviation: limits and standard deviation of the prior.
    """

    fitted: float
    mean: float
    standard_deviation: float
    interval: tuple[float, float]
    searched: tuple[float, float]
    prior_deviation: float


@dataclass(frozen=True, eq=False)
class SessionFit:
    """What the counts say of one session.

    Attributes
    ----------
    name: of the session, or of its only die if it has none (`is_named`).
    material: of its first die.
    size: of its dice in m, if known and equal; else `SIZE`.
    quantiles: (3, 3) of the session's mean height, speed and spin in units of the die: least of
        the credible interval, median, and most, in rows.
    table: fitted table of the material, with the medians as throws, within what is simulated.
    tables: equally likely tables of the material, each with throws of this session.
    """

    name: str
    is_named: bool
    material: str
    size: float
    quantiles: Floats
    table: Table
    tables: tuple[Table, ...]

    @property
    def typical(self) -> Floats:
        """Medians (3,) in m, m/s and rad/s for a die of the session's size."""
        ratio = self.size / SIZE
        return np.asarray(self.quantiles[1] * UNITS * [ratio, ratio**0.5, ratio**-0.5])


@dataclass(frozen=True, eq=False)
class DieFit:
    """Predictions of the posterior for one die.

    Attributes
    ----------
    die: with its counts, which may be 0 if they were not used in the fit.
    probabilities, deviation: (g,) mean and standard deviation of its probabilities in a new
        session, or in the only one, with scatter as in all predictions.
    whole: prediction of another such die in the die's own session, by the posterior of all counts.
        Its p-value is slightly optimistic, as the counts are part of the posterior. None for a die
        that was not used in the fit.
    left_out: prediction of the die in its session, by the posterior of the other dice's counts.
        None without counts.
    drawn: (m, g) equally likely probabilities in that session, by the surrogate's means and
        without scatter.
    """

    die: CountedDie
    probabilities: Floats
    deviation: Floats
    whole: Prediction | None
    left_out: Prediction | None
    drawn: Floats


@dataclass(frozen=True)
class TableFit:
    """Fitted tables with their uncertainty.

    Attributes
    ----------
    tables: most likely table of each material, with the center of all sessions as throws, to three
        digits (see `SHARPNESS`); first that of the first die.
    posterior: equally likely tables of the first material, each with the throws of a new session;
        of the same session if there is only one.
    parameters: posteriors of the d parameters of `Prior`, in that order.
    correlations: (d, d) of the posterior, of logarithms where the prior is flat in these.
    dice: the fitted dice, then the others.
    sessions: of the fitted dice.
    evaluations: number of simulated sets of parameters; drops: of each die for each set.
    log_likelihood: of all counts at the fitted set by the surrogates, minus its largest possible
        value without scatter.
    effective_points: effective sample size of the posterior's points.
    """

    tables: dict[str, Table]
    posterior: tuple[Table, ...]
    parameters: dict[str, FittedParameter]
    correlations: Floats
    dice: tuple[DieFit, ...]
    sessions: tuple[SessionFit, ...]
    evaluations: int
    drops: int
    log_likelihood: float
    effective_points: float


FIRST: Final = 0.5
"""Share of the evaluations that are spread over the prior; the others follow the posterior, in
`ROUNDS` rounds."""

ROUNDS: Final = 4

SHARPNESS: Final = 8
"""Power of the likelihood whose mean is the fitted set: near the most likely set for parameters
that the counts determine, and central for others."""

FEWEST_EVALUATIONS: Final = 32

PILOT: Final = (2**11, 2**3)

FINAL: Final = (2**12, 2**5)
"""Points for each proposal distribution of the posterior, and sessions at each point, before and
after the last simulation."""

DRAWS: Final = 2**10
"""Number of sets that represent the posterior in predictions."""

TABLES: Final = 32
"""Number of posterior tables of a fitted table."""


def check_effort(evaluations: int, drops: int, seed: int) -> None:
    """Raise InputError for fewer than `FEWEST_EVALUATIONS`, no drop, or an invalid seed."""
    check_whole("evaluations", evaluations, FEWEST_EVALUATIONS)
    check_whole("drops", drops)
    check_whole("seed", seed, least=0, most=MOST_SEED)


def fit_table(
    dice: Sequence[CountedDie],
    start: Table,
    evaluations: int,
    drops: int,
    seed: int,
    *,
    others: Sequence[CountedDie] = (),
    workers: Executor,
    checkpoint: Checkpoint | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> TableFit:
    """Fit a table to counts of real dice, by the model of `sessions`.

    Sets of restitution, friction and a session's throws are simulated, first over all of them and
    then over the posterior of each material. The simulated probabilities of each die are
    interpolated by a smooth surrogate. The likelihood of the real counts is averaged over the
    surrogate's uncertainty and over sessions. Each set has its own random numbers: common ones
    would not correlate the noise of neighboring sets, since bounces separate equal throws. Of the
    published 2d6, released identically, 14 % end on one rest if the restitution differs by a
    thousandth, and 13 % by chance.

    Parameters
    ----------
    start: name and source of the table.
    evaluations, drops, seed: see `check_effort`; drops are of each die for each set.
    others: dice that are predicted but not used in the fit.
    checkpoint: of a fit with these arguments; earlier simulations are read from it, new ones are
        added.
    progress: called with the number of drops of each die that was thrown.
    """
    saved = checkpoint or Checkpoint()
    every = [*dice, *others]
    prior = Prior(tuple(dict.fromkeys(die.material for die in every)))
    dimensions = len(prior.limits)
    first = round(FIRST * evaluations)
    rng = np.random.default_rng(seed)
    sets = [np.empty((0, len(SIMULATED)))] * len(every)
    counts = [np.empty((0, len(die.labels)), dtype=np.int64) for die in every]

    def add(points: Sequence[Floats]) -> None:
        """Simulate throws at further points (n, 5) of each die."""
        so_far = len(sets[0])
        added = set_counts(every, start, points, drops, seed, so_far, workers, saved, progress)
        sets[:] = map(np.concatenate, zip(sets, points, strict=True))
        counts[:] = map(np.concatenate, zip(counts, added, strict=True))

    def surrogates_of(dice: Sequence[CountedDie]) -> list[ProbabilitySurrogate]:
        each = zip(dice, sets, counts, strict=False)
        return [ProbabilitySurrogate.through(*one) for one in each]

    def sample(
        surrogates: Sequence[ProbabilitySurrogate], effort: tuple[int, int], is_final: bool
    ) -> WeightedPoints:
        offsets = session_offsets(effort[1], rng)
        return sample_posterior(
            lambda points: log_likelihoods(prior, surrogates, points, offsets, is_final),
            dimensions,
            effort[0],
            rng,
            leave_one_out=is_final,
        )

    spread = qmc.Sobol(len(SIMULATED), rng=rng).random_base2((first - 1).bit_length())[:first]
    add([spread] * len(every))
    for batch in np.array_split(np.arange(first, evaluations), ROUNDS):
        offsets = session_offsets(2 ** (len(batch) - 1).bit_length(), rng)[: len(batch)]
        pilot = sample(surrogates_of(dice), PILOT, False)
        drawn = _resample(pilot.points, pilot.weights(), len(batch), rng)
        add([prior.session_points(drawn, offsets, die.material) for die in every])
    surrogates = surrogates_of(every)
    fitted_to = surrogates[: len(dice)]
    posterior = sample(fitted_to, FINAL, True)
    sharp = posterior.log_priors + SHARPNESS * posterior.log_likelihoods[:, 0]
    best = np.exp(sharp - logsumexp(sharp)) @ posterior.points
    height = log_likelihoods(prior, fitted_to, best[None], session_offsets(FINAL[1], rng), True)
    parameters, correlations = _summary(prior, posterior, prior.values(best))
    tables = {
        material: table_of(start, prior.session_values(best, np.zeros(3), material))
        for material in prior.materials
    }
    unknown = _draw_tables(prior, posterior, prior.materials[0], (), start, rng)
    dice_fits = tuple(
        _die_fit(prior, one, posterior, fitted_to, i if i < len(dice) else None, rng)
        for i, one in enumerate(surrogates)
    )
    sessions = _session_fits(prior, posterior, fitted_to, tables, rng)
    return TableFit(
        tables=tables,
        posterior=sessions[0].tables if len(sessions) == 1 else unknown,
        parameters=parameters,
        correlations=correlations,
        dice=dice_fits,
        sessions=sessions,
        evaluations=evaluations,
        drops=drops,
        log_likelihood=float(height[0, 0]),
        effective_points=effective(posterior.weights()),
    )


def _draw_tables(
    prior: Prior,
    posterior: WeightedPoints,
    material: str,
    members: Sequence[ProbabilitySurrogate],
    start: Table,
    rng: np.random.Generator,
) -> tuple[Table, ...]:
    """Equally likely tables of a material, each with throws of the session of some dice; without
    dice, of a new session."""
    points = _resample(posterior.points, posterior.weights(), TABLES, rng)
    offsets = _draw_hands(prior, points, members, rng)
    values = simulated_values(prior.session_points(points, offsets, material))
    values[:, 2] = np.maximum(values[:, 2], LOWEST)
    return tuple(table_of(start, row) for row in values)


def _resample(points: Floats, weights: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Equally likely points (count, d) in random order, by systematic resampling."""
    places = (np.arange(count) + rng.random()) / count
    numbers = np.searchsorted(weights.cumsum(), places).clip(max=len(weights) - 1)
    return points[rng.permutation(numbers)]


def _draw_hands(
    prior: Prior,
    points: Floats,
    members: Sequence[ProbabilitySurrogate],
    rng: np.random.Generator,
) -> Offsets:
    """Sessions (n, 3) at points (n, d) of the prior, by the counts of some of their dice."""
    if not members:
        return session_offsets(len(points), rng)
    hands = session_offsets(FINAL[1], rng)
    by_hand = np.sum([one.by_session(prior, points, hands, True) for one in members], axis=0)
    chances = np.exp(by_hand - logsumexp(by_hand, axis=1, keepdims=True))
    chosen = (chances.cumsum(axis=1) < rng.random((len(points), 1))).sum(axis=1)
    return np.asarray(hands[chosen.clip(max=len(hands) - 1)])


def scatter_probabilities(
    probabilities: Floats, concentration: Floats, rng: np.random.Generator
) -> Floats:
    """Random probabilities (m, g) of Dirichlet distributions with means (m, g) and concentrations
    (m,)."""
    parts = rng.standard_gamma(concentration[:, None] * probabilities)
    # A rare outcome may underflow to 0, whose logarithm is infinite.
    parts = np.maximum(parts, np.finfo(np.float64).tiny)
    return np.asarray(parts / parts.sum(axis=1, keepdims=True))


def _die_fit(
    prior: Prior,
    surrogate: ProbabilitySurrogate,
    posterior: WeightedPoints,
    fitted_to: Sequence[ProbabilitySurrogate],
    number: int | None,
    rng: np.random.Generator,
) -> DieFit:
    """Predictions for a die; number: its place among the fitted dice, or None."""
    die = surrogate.die
    members = [one for one in fitted_to if one.die.session_key == die.session_key]

    def draw(without: int | None, members: Sequence[ProbabilitySurrogate]) -> tuple[Floats, Floats]:
        """Points (m, 5) of equally likely sessions, and the die's probabilities (m, g) there."""
        points = _resample(posterior.points, posterior.weights(without), DRAWS, rng)
        offsets = _draw_hands(prior, points, members, rng)
        at = prior.session_points(points, offsets, die.material)
        means = surrogate.probabilities(at, rng)
        return at, scatter_probabilities(means, prior.concentration(points), rng)

    is_single = len({one.die.session_key for one in fitted_to}) == 1
    fresh, probabilities = draw(None, fitted_to if is_single else ())
    whole = left_out = None
    if number is not None:
        whole = predict(die.counts, draw(None, members)[1], rng)
    if die.counts.any():
        others = [one for one in members if one is not surrogate]
        left_out = predict(die.counts, draw(number, others)[1], rng)
    return DieFit(
        die=die,
        probabilities=probabilities.mean(axis=0),
        deviation=probabilities.std(axis=0),
        whole=whole,
        left_out=left_out,
        drawn=surrogate.probabilities(fresh),
    )


def _session_fits(
    prior: Prior,
    posterior: WeightedPoints,
    fitted_to: Sequence[ProbabilitySurrogate],
    tables: dict[str, Table],
    rng: np.random.Generator,
) -> tuple[SessionFit, ...]:
    """Posteriors of the hands of each session. tables: fitted table of each material."""
    least, most = np.transpose([SIMULATED[name] for name in SPREADS])
    least[0] = LOWEST
    fits = []
    for key in dict.fromkeys(one.die.session_key for one in fitted_to):
        members = [one for one in fitted_to if one.die.session_key == key]
        die, sizes = members[0].die, {one.die.size for one in members}
        points = _resample(posterior.points, posterior.weights(), DRAWS, rng)
        offsets = _draw_hands(prior, points, members, rng)
        hands = prior.session_values(points, offsets, die.material)[:, 2:]
        tail = (1.0 - CREDIBLE_LEVEL) / 2.0
        quantiles = np.quantile(hands, [tail, 0.5, 1.0 - tail], axis=0)
        size = die.size if len(sizes) == 1 and die.size is not None else SIZE
        is_named, name = die.session is not None, die.session or die.name
        surface = tables[die.material]
        surface = replace(surface, name=f"{surface.name}_{printable(name)}")
        hand = np.clip(quantiles[1], least, most)
        table = table_of(surface, np.array([surface.restitution, surface.friction, *hand]))
        drawn = _draw_tables(prior, posterior, die.material, members, surface, rng)
        fits.append(SessionFit(name, is_named, die.material, size, quantiles, table, drawn))
    return tuple(fits)


def _summary(
    prior: Prior, posterior: WeightedPoints, best: Floats
) -> tuple[dict[str, FittedParameter], Floats]:
    """Posteriors of the parameters, and their correlations (d, d)."""
    weights, values = posterior.weights(), prior.values(posterior.points)
    means = weights @ values
    deviations = np.sqrt(weights @ (values - means) ** 2)
    scaled = posterior.points - weights @ posterior.points
    scaled /= np.sqrt(weights @ scaled**2)
    evenly = np.tile((np.arange(DRAWS)[:, None] + 0.5) / DRAWS, len(best))
    before = prior.values(evenly).std(axis=0)
    parameters = {}
    for i, (name, searched) in enumerate(prior.limits.items()):
        order = np.argsort(values[:, i])
        tail = (1.0 - CREDIBLE_LEVEL) / 2.0
        at = np.searchsorted(weights[order].cumsum(), [tail, 1.0 - tail])
        low, high = values[order[np.minimum(at, len(order) - 1)], i].tolist()
        parameters[name] = FittedParameter(
            round_value(best[i]),
            float(means[i]),
            float(deviations[i]),
            (low, high),
            searched,
            float(before[i]),
        )
    return parameters, scaled.T @ (weights[:, None] * scaled)
