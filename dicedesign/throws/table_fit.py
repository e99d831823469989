"""A table fitted to counts of several real dice, each thrown in a session of its own, and its
predictions for dice."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import logsumexp, xlogy
from scipy.stats import qmc

from dicedesign.errors import MOST_SEED, check_whole
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.throws.distances import jeffreys_means
from dicedesign.throws.goodness_of_fit import (
    ChiSquareTest,
    MultinomialTest,
    chi_square,
    exact_multinomial,
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
    PARAMETERS,
    draw_values,
    round_value,
    session_offsets,
    session_points,
    set_counts,
    shared_values,
    table_of,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table
from dicedesign.throws.throw_counts import CountedDie

SERIES: Final = 4000
"""Simulated series of throws for a p-value, whose standard error is then below 0.008."""


@dataclass(frozen=True)
class Prediction:
    """Comparison of the counts of one die with their posterior prediction.

    Attributes
    ----------
    probabilities, deviation: (g,) mean and standard deviation of the predicted probabilities.
    p_value: share of predicted series of throws with at most the likelihood ratio of the real
        series: likelihood by the prediction over likelihood by the series' own frequencies.
    standard_error: of the p-value.
    worst: outcome whose count deviates most from the prediction.
    interval: of its count in 95 % of predicted series.
    """

    probabilities: Floats
    deviation: Floats
    p_value: float
    standard_error: float
    worst: int
    interval: tuple[int, int]


def predict(counts: Integers, probabilities: Floats, rng: np.random.Generator) -> Prediction:
    """Compare counts (g,) with a prediction, equally likely probabilities (m, g).

    Source: Gelman, Meng and Stern, Statistica Sinica 6, 1996, with the likelihood ratio of the
    mixture of all probabilities as discrepancy.
    """
    throws = int(counts.sum())
    series = rng.multinomial(throws, probabilities[np.arange(SERIES) % len(probabilities)])
    both = np.concatenate([[counts], series])
    # In place: temporary arrays of this size take most of the time.
    likelihoods = np.logaddexp.reduce(both @ np.log(probabilities).T, axis=1)
    fits = likelihoods - xlogy(both, both / throws).sum(axis=1)
    # The real series is included, so that no p-value is 0. Equal ratios may differ by rounding.
    worse = int((fits <= fits[0] + 1e-9 * abs(fits[0])).sum())
    p_value = worse / len(both)
    spread = np.maximum(series.std(axis=0), 0.5)
    worst = int((np.abs(counts - series.mean(axis=0)) / spread).argmax())
    low, high = np.quantile(series[:, worst], [0.025, 0.975])
    return Prediction(
        probabilities.mean(axis=0),
        probabilities.std(axis=0),
        p_value,
        float(np.sqrt(p_value * (1.0 - p_value) / len(both))),
        worst,
        (round(low), round(high)),
    )


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


def check_table(
    dice: Sequence[CountedDie],
    table: Table,
    drops: int,
    seed: int,
    *,
    workers: Executor | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> tuple[DieCheck, ...]:
    """Simulate throws of each die on a table, and compare them with its counts.

    Parameters and errors are as in `simulate`. Dice of unknown size have the table's; dice larger
    than the least height are released from their own size.
    """
    checks = []
    for die in dice:
        lifted = table.for_size_above(die.size)
        throws = simulate(die.body, lifted, drops, seed, workers=workers, progress=progress)
        simulated = die.by_outcome(throws.counts)
        checks.append(
            DieCheck(
                die=die,
                simulated=simulated,
                unresolved=throws.unresolved,
                chi_square=two_sample_chi_square(die.counts, simulated),
                exact=exact_multinomial(die.counts, jeffreys_means(simulated)),
                geometric=chi_square(die.counts, die.geometric),
            )
        )
    return tuple(checks)


CREDIBLE_LEVEL: Final = 0.9
"""Posterior probability of the interval of each parameter."""


@dataclass(frozen=True)
class FittedParameter:
    """Posterior of one shared parameter, in the unit of `Table`.

    Attributes
    ----------
    fitted: value in the fitted set.
    mean, standard_deviation: of the posterior.
    interval: equal-tailed credible interval of the level `CREDIBLE_LEVEL`.
    searched: limits of the flat prior.
    """

    fitted: float
    mean: float
    standard_deviation: float
    interval: tuple[float, float]
    searched: tuple[float, float]


@dataclass(frozen=True, eq=False)
class DieFit:
    """Predictions of the posterior for one die.

    Attributes
    ----------
    die: with its counts, which may be 0 if they were not used in the fit.
    probabilities, deviation: (g,) mean and standard deviation of its probabilities in a new
        session.
    whole: prediction of more throws in the die's own session, by the posterior of all counts. Its
        p-value is slightly optimistic, as the counts are part of the posterior. None for a die that
        was not used in the fit.
    left_out: prediction of a session of the die, by the posterior of the other dice's counts. None
        without counts.
    drawn: (m, g) equally likely probabilities in a new session, by the surrogate's means.
    """

    die: CountedDie
    probabilities: Floats
    deviation: Floats
    whole: Prediction | None
    left_out: Prediction | None
    drawn: Floats


@dataclass(frozen=True)
class TableFit:
    """Fitted table with its uncertainty.

    Attributes
    ----------
    table: most likely table if all sessions have one throw distribution, to three digits (see
        `SHARPNESS`).
    posterior: equally likely tables, each with the throws of a random session.
    parameters: posteriors of `PARAMETERS`, in that order; height, speed and spin are the centers of
        all sessions.
    correlations: (5, 5) of the posterior, with logarithms of height, speed and spin.
    dice: the fitted dice, then the others.
    evaluations: number of simulated sets of parameters; drops: of each die for each set.
    log_likelihood: of all counts at `table` by the surrogates, minus its largest possible value.
    effective_points: effective sample size of the posterior's points.
    """

    table: Table
    posterior: tuple[Table, ...]
    parameters: dict[str, FittedParameter]
    correlations: Floats
    dice: tuple[DieFit, ...]
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
    """Fit a table to counts of real dice.

    All dice share restitution, friction and the center of the sessions' throws. Each die was
    thrown in a session with its own height, speed and spin (see `sessions`).
    Sets of restitution, friction and a session's throws are simulated, first over the prior and
    then over the posterior. The simulated probabilities of each die are interpolated by a smooth
    surrogate. The likelihood of the real counts is averaged over the surrogate's uncertainty and
    over sessions. Each set has its own random numbers: common ones would not correlate the noise of
    neighboring sets, since bounces separate equal throws. Of the published 2d6, released
    identically, 14 % end on one rest if the restitution differs by a thousandth, and 13 % by
    chance.

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
    first = round(FIRST * evaluations)
    rng = np.random.default_rng(seed)
    sets = np.empty((0, len(PARAMETERS)))
    counts = [np.empty((0, len(die.labels)), dtype=np.int64) for die in every]

    def add(points: Floats) -> None:
        """Simulate throws at further points (n, 5)."""
        nonlocal sets
        added = set_counts(every, start, points, drops, seed, len(sets), workers, saved, progress)
        sets = np.concatenate([sets, points])
        counts[:] = map(np.concatenate, zip(counts, added, strict=True))

    def surrogates_of(dice: Sequence[CountedDie]) -> list[ProbabilitySurrogate]:
        each = zip(dice, counts, strict=False)
        return [ProbabilitySurrogate.through(die, sets, of_die) for die, of_die in each]

    def sample(
        surrogates: Sequence[ProbabilitySurrogate], effort: tuple[int, int], is_final: bool
    ) -> WeightedPoints:
        offsets = session_offsets(effort[1], rng)
        return sample_posterior(
            lambda points: log_likelihoods(surrogates, points, offsets, is_final),
            len(PARAMETERS),
            effort[0],
            rng,
            leave_one_out=is_final,
        )

    add(qmc.Sobol(len(PARAMETERS), rng=rng).random_base2((first - 1).bit_length())[:first])
    for batch in np.array_split(np.arange(first, evaluations), ROUNDS):
        # Sessions of unknown size, so that the sets spread as far as any die's.
        offsets = session_offsets(2 ** (len(batch) - 1).bit_length(), rng)[: len(batch)]
        pilot = sample(surrogates_of(dice), PILOT, False)
        drawn = _resample(pilot.points, pilot.weights(), len(batch), rng)
        add(session_points(drawn, offsets, None))
    surrogates = surrogates_of(every)
    fitted_to = surrogates[: len(dice)]
    posterior = sample(fitted_to, FINAL, True)
    center = np.array([[0.0, 0.0, 0.0, 0.5]])

    def heights(points: Floats) -> Floats:
        """Log likelihoods (n,) of all counts, with the central throws in all sessions."""
        return np.asarray(log_likelihoods(fitted_to, points, center, True).sum(axis=1))

    logarithms = posterior.log_priors + SHARPNESS * heights(posterior.points)
    best = np.exp(logarithms - logsumexp(logarithms)) @ posterior.points
    values = shared_values(best)
    parameters, correlations = _summary(posterior, values)
    drawn = _resample(posterior.points, posterior.weights(), TABLES, rng)
    drawn_tables = draw_values(drawn, session_offsets(TABLES, rng))
    return TableFit(
        table=table_of(start, values),
        posterior=tuple(table_of(start, row) for row in drawn_tables),
        parameters=parameters,
        correlations=correlations,
        dice=tuple(
            _die_fit(one, posterior, i if i < len(dice) else None, rng)
            for i, one in enumerate(surrogates)
        ),
        evaluations=evaluations,
        drops=drops,
        log_likelihood=float(heights(best[None])[0]),
        effective_points=effective(posterior.weights()),
    )


def _resample(points: Floats, weights: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Equally likely points (count, d) in random order, by systematic resampling."""
    places = (np.arange(count) + rng.random()) / count
    numbers = np.searchsorted(weights.cumsum(), places).clip(max=len(weights) - 1)
    return points[rng.permutation(numbers)]


def _die_fit(
    surrogate: ProbabilitySurrogate,
    posterior: WeightedPoints,
    number: int | None,
    rng: np.random.Generator,
) -> DieFit:
    """Predictions for a die; number: its column in the likelihoods, or None."""
    die = surrogate.die
    points = _resample(posterior.points, posterior.weights(), DRAWS, rng)
    fresh = session_points(points, session_offsets(DRAWS, rng), die.size)
    probabilities = surrogate.probabilities(fresh, rng)
    whole, left_out = None, predict(die.counts, probabilities, rng) if die.counts.any() else None
    if number is not None:
        hands = session_offsets(FINAL[1], rng)
        by_session = surrogate.by_session(points, hands, True)
        chances = np.exp(by_session - logsumexp(by_session, axis=1, keepdims=True))
        chosen = (chances.cumsum(axis=1) < rng.random((DRAWS, 1))).sum(axis=1)
        same = session_points(points, hands[chosen.clip(max=len(hands) - 1)], die.size)
        whole = predict(die.counts, surrogate.probabilities(same, rng), rng)
        others = _resample(posterior.points, posterior.weights(number), DRAWS, rng)
        without = session_points(others, session_offsets(DRAWS, rng), die.size)
        left_out = predict(die.counts, surrogate.probabilities(without, rng), rng)
    return DieFit(
        die=die,
        probabilities=probabilities.mean(axis=0),
        deviation=probabilities.std(axis=0),
        whole=whole,
        left_out=left_out,
        drawn=surrogate.probabilities(fresh),
    )


def _summary(posterior: WeightedPoints, best: Floats) -> tuple[dict[str, FittedParameter], Floats]:
    """Posteriors of the parameters, and their correlations (5, 5)."""
    weights, values = posterior.weights(), shared_values(posterior.points)
    means = weights @ values
    deviations = np.sqrt(weights @ (values - means) ** 2)
    scaled = posterior.points - weights @ posterior.points
    scaled /= np.sqrt(weights @ scaled**2)
    parameters = {}
    for i, (name, searched) in enumerate(PARAMETERS.items()):
        order = np.argsort(values[:, i])
        tail = (1.0 - CREDIBLE_LEVEL) / 2.0
        at = np.searchsorted(weights[order].cumsum(), [tail, 1.0 - tail])
        low, high = values[order[np.minimum(at, len(order) - 1)], i].tolist()
        parameters[name] = FittedParameter(
            round_value(best[i]), float(means[i]), float(deviations[i]), (low, high), searched
        )
    return parameters, scaled.T @ (weights[:, None] * scaled)
