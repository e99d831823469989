"""One table fitted to counts of several real dice, each thrown in a session of its own, and what it
predicts of a die."""

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
"""Series of throws that are drawn for a p-value, whose standard error so is below 0.008."""


@dataclass(frozen=True)
class Prediction:
    """Counts of one die beside their posterior prediction.

    Attributes
    ----------
    probabilities, deviation: (g,) mean and standard deviation of the probabilities by the
        prediction.
    p_value: part of predicted series of throws that go no better with the prediction than the real
        one, by the ratio of their likelihood by the prediction over that by their own frequencies.
    standard_error: of the p-value.
    worst: the outcome that came up most unlike the prediction.
    interval: that holds its count in 95 % of predicted series.
    """

    probabilities: Floats
    deviation: Floats
    p_value: float
    standard_error: float
    worst: int
    interval: tuple[int, int]


def predict(counts: Integers, probabilities: Floats, rng: np.random.Generator) -> Prediction:
    """Counts (g,) against a prediction: equally likely probabilities (m, g).

    Source: Gelman, Meng and Stern, Statistica Sinica 6, 1996, with the likelihood ratio of the
    mixture of all probabilities as discrepancy.
    """
    throws = int(counts.sum())
    series = rng.multinomial(throws, probabilities[np.arange(SERIES) % len(probabilities)])
    both = np.concatenate([[counts], series])
    # In place: temporary arrays of this size take most of the time.
    likelihoods = np.logaddexp.reduce(both @ np.log(probabilities).T, axis=1)
    fits = likelihoods - xlogy(both, both / throws).sum(axis=1)
    # The real series counts as one more, so that no p-value is 0; equal ones differ by rounding.
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


def expected_deviations(values: Floats, probabilities: Floats, throws: Sequence[int]) -> Floats:
    """Standard deviations (t, p) that are left of p parameters after each of t numbers of throws.

    The best estimate that is linear in the frequencies takes part of the variance, the more, the
    larger the covariance of a parameter with the probabilities is beside what sessions and chance
    do to the frequencies. Estimates that are not linear leave no more.

    Source: Goldstein and Wooff, Bayes Linear Statistics, 2007, section 1.3.

    Parameters
    ----------
    values: (m, p) equally likely sets of parameters, as they are known before.
    probabilities: (m, g) of the die in a session at each.
    throws: in one session.
    """
    known, part = values - values.mean(axis=0), probabilities - probabilities.mean(axis=0)
    covariance = known.T @ part / len(probabilities)
    between = part.T @ part / len(probabilities)
    chance = np.diag(probabilities.mean(axis=0)) - probabilities.T @ probabilities / len(
        probabilities
    )
    left = []
    for count in throws:
        # Frequencies sum to 1, which leaves one direction without variance.
        gain = covariance @ np.linalg.pinv(between + chance / count, hermitian=True) @ covariance.T
        left.append(np.sqrt(np.maximum(known.var(axis=0) - np.diag(gain), 0.0)))
    return np.array(left)


@dataclass(frozen=True)
class DieCheck:
    """Real throws of one die beside simulated ones.

    Attributes
    ----------
    die: what was thrown.
    simulated: (g,) how often each outcome came up in simulation.
    unresolved: simulated drops that ended nowhere.
    chi_square: whether real and simulated throws can have the same probabilities, whatever these
        are.
    exact: whether the real ones can have the probabilities simulated, as if those were known.
    geometric: whether the real ones can have the probabilities without momentum.
    """

    die: CountedDie
    simulated: Integers
    unresolved: int
    chi_square: ChiSquareTest
    exact: MultinomialTest
    geometric: ChiSquareTest

    @property
    def probabilities(self) -> Floats:
        """(g,) simulated probabilities, above 0, by the prior of Jeffreys."""
        return jeffreys_means(self.simulated)


def check_table(
    dice: Sequence[CountedDie],
    table: Table,
    drops: int,
    seed: int,
    *,
    workers: Executor | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[DieCheck, ...]:
    """Throw each die on a table, and compare with its counts.

    Parameters and errors: as of `simulate`. Dice whose size is unknown have the table's; larger
    ones than it lets fall are let go from as high as they are large.
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


MORE: Final = (50, 100, 200, 400, 800, 1600)
"""Numbers of throws whose information is predicted."""

CREDIBLE_LEVEL: Final = 0.9
"""Posterior probability of the interval of each parameter."""


@dataclass(frozen=True)
class FittedParameter:
    """One shared parameter by the counts, in the unit of `Table`.

    Attributes
    ----------
    fitted: its value in the fitted set.
    mean, standard_deviation: of the posterior.
    interval: that holds it with the posterior probability `CREDIBLE_LEVEL`, as much below as above.
    searched: limits of the search, between which the prior is flat.
    """

    fitted: float
    mean: float
    standard_deviation: float
    interval: tuple[float, float]
    searched: tuple[float, float]


@dataclass(frozen=True, eq=False)
class DieFit:
    """One die by the posterior.

    Attributes
    ----------
    die: with its counts, which may all be 0 where the die was not fitted to.
    probabilities, deviation: (g,) mean and standard deviation of its probabilities in a new
        session.
    whole: what the posterior of all counts predicts of more throws in the session of that die; its
        p-value is a little flattered, as the counts themselves are in the posterior. None for a die
        that was not fitted to.
    left_out: what the posterior of the other dice's counts alone predicts of a session of the die.
        None without counts.
    drawn: (m, g) equally likely probabilities in a new session, by the surrogate's best estimate.
    after: (t, 2) standard deviations of restitution and friction that `MORE` throws of the die
        would be expected to leave.
    """

    die: CountedDie
    probabilities: Floats
    deviation: Floats
    whole: Prediction | None
    left_out: Prediction | None
    drawn: Floats
    after: Floats


@dataclass(frozen=True)
class TableFit:
    """A fitted table with its uncertainty.

    Attributes
    ----------
    table: under which, as the hand of all sessions, the counts are likeliest; to three digits (see
        `SHARPNESS`).
    posterior: equally likely tables, each with the hand of a session drawn too.
    parameters: each of `PARAMETERS`, in that order; the hand is the center of all sessions.
    correlations: (5, 5) of the posterior, of the hand's logarithms.
    dice: those that were fitted to, and then those that were not.
    evaluations: sets of parameters that were simulated; drops: of each die for each set.
    log_likelihood: of the counts of all dice at `table`, by the surrogates, less what frequencies
        equal to the probabilities would give.
    surprise: root mean square deviation of simulated log probabilities from what the surrogates
        predict without them, in standard deviations: near 1 if they are right about their
            uncertainty.
    effective_points: of the points at which the posterior was computed, how many equal ones would
        be as good.
    """

    table: Table
    posterior: tuple[Table, ...]
    parameters: dict[str, FittedParameter]
    correlations: Floats
    dice: tuple[DieFit, ...]
    evaluations: int
    drops: int
    log_likelihood: float
    surprise: float
    effective_points: float


FIRST: Final = 0.5
"""Part of the evaluations that are spread over all throws; the others are where the posterior is
after the first, in `ROUNDS` rounds."""

ROUNDS: Final = 4

SHARPNESS: Final = 8
"""The fitted set is the mean of the likelihood raised to this power: near the likeliest set where
the counts tell, and in the middle where they do not."""

FEWEST_EVALUATIONS: Final = 32

PILOT: Final = (2**11, 2**3)

FINAL: Final = (2**12, 2**5)
"""Points for each distribution that the posterior is drawn with, and sessions at each, while it is
only asked where to simulate and at last."""

DRAWS: Final = 2**10
"""Sets that stand for the posterior in predictions."""

TABLES: Final = 32
"""Sets of the posterior that a fitted table brings along."""


def check_effort(evaluations: int, drops: int, seed: int) -> None:
    """Raise InputError for fewer than `FEWEST_EVALUATIONS`, no drop, or a seed below 0."""
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
    progress: Callable[[int], None] | None = None,
) -> TableFit:
    """Fit a table to what came up.

    Restitution and friction are the same for all dice, and so is the center of all hands; each die
    was thrown in a session with a hand of its own about it (see `sessions`). Sets of restitution,
    friction and a session's hand are simulated, first all over the limits and then where the
    posterior is. Through the simulated probabilities of every die goes a smooth surrogate, which
    averages over the sampling noise of neighboring sets; the likelihood of the real counts is the
    mean of that by its probabilities over its own uncertainty and over sessions. Each set has
    random numbers of its own. Common ones would make the noise of neighboring sets the same only if
    the same drop ended alike in both, but bounces part them: of the published 2d6, let go alike, 12
    % end on the same rest when the restitution differs by a thousandth, and 12 % by chance.

    Parameters
    ----------
    start: has the name and the source.
    evaluations: sets of parameters, at least `FEWEST_EVALUATIONS`. drops: of each die, above 0.
    seed: of the drops and of the sets.
    others: dice that are predicted and not fitted to.
    checkpoint: of the same arguments; what was simulated before is taken from it, and what is
        simulated is added.
    progress: called with the number of drops of each die that was thrown.

    The numbers are as of `check_effort`.
    """
    saved = checkpoint or Checkpoint()
    every = [*dice, *others]
    first = round(FIRST * evaluations)
    rng = np.random.default_rng(seed)
    sets = qmc.Sobol(len(PARAMETERS), rng=rng).random_base2((first - 1).bit_length())[:first]
    counts = set_counts(every, start, sets, drops, seed, 0, workers, saved, progress)

    def surrogates_of(dice: Sequence[CountedDie]) -> list[ProbabilitySurrogate]:
        each = zip(dice, counts, strict=False)
        return [ProbabilitySurrogate.through(die, sets, of_die) for die, of_die in each]

    def weighted(
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

    for batch in np.array_split(np.arange(first, evaluations), ROUNDS):
        # Hands of sessions with unknown sizes spread the sets as far as any die's.
        offsets = session_offsets(2 ** (len(batch) - 1).bit_length(), rng)[: len(batch)]
        pilot = weighted(surrogates_of(dice), PILOT, False)
        drawn = _resample(pilot.points, pilot.weights(), len(batch), rng)
        more = session_points(drawn, offsets, None)
        added = set_counts(every, start, more, drops, seed, len(sets), workers, saved, progress)
        sets = np.concatenate([sets, more])
        counts = [np.concatenate(pair) for pair in zip(counts, added, strict=True)]
    surrogates = surrogates_of(every)
    fitted_to = surrogates[: len(dice)]
    posterior = weighted(fitted_to, FINAL, True)
    center = np.array([[0.0, 0.0, 0.0, 0.5]])

    def heights(points: Floats) -> Floats:
        """Logarithms (n,) of the likelihood of all counts, if all sessions had the hand."""
        return np.asarray(log_likelihoods(fitted_to, points, center, True).sum(axis=1))

    logarithms = posterior.log_priors + SHARPNESS * heights(posterior.points)
    best = np.exp(logarithms - logsumexp(logarithms)) @ posterior.points
    surprises = [process.surprises() for one in surrogates for process in one.processes]
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
        surprise=float(np.sqrt(np.square(np.concatenate(surprises)).mean())),
        effective_points=effective(posterior.weights()),
    )


def _resample(points: Floats, weights: Floats, count: int, rng: np.random.Generator) -> Floats:
    """(count, d) equally likely points, each as often as its weight has it to one less or more, in
    random order."""
    places = (np.arange(count) + rng.random()) / count
    numbers = np.searchsorted(weights.cumsum(), places).clip(max=len(weights) - 1)
    return points[rng.permutation(numbers)]


def _die_fit(
    surrogate: ProbabilitySurrogate,
    posterior: WeightedPoints,
    number: int | None,
    rng: np.random.Generator,
) -> DieFit:
    """The predictions of a die; number: its place in the likelihoods, None if it has none."""
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
        after=expected_deviations(shared_values(points)[:, :2], probabilities, MORE),
    )


def _summary(posterior: WeightedPoints, best: Floats) -> tuple[dict[str, FittedParameter], Floats]:
    """The parameters, and their correlations (5, 5)."""
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
        # No counts determine more digits than these.
        fitted = float(f"{best[i]:.3g}")
        parameters[name] = FittedParameter(
            fitted, float(means[i]), float(deviations[i]), (low, high), searched
        )
    return parameters, scaled.T @ (weights[:, None] * scaled)
