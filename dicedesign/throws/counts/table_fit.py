"""One set of throw parameters fitted to counts of several real dice."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Final

import numpy as np
from scipy.stats import qmc

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checkpoint import Checkpoint
from dicedesign.runtime.checks import MOST_SEED, check_whole
from dicedesign.runtime.executors import in_order
from dicedesign.throws.counts.odds_surrogate import OddsSurrogate
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.simulation.simulation import simulate
from dicedesign.throws.tables import Table

__all__ = [
    "PARAMETERS",
    "FittedParameter",
    "TableFit",
    "check_effort",
    "fit_table",
    "outcome_counts",
]

PARAMETERS: Final[Mapping[str, tuple[float, float]]] = {
    "restitution": (0.1, 0.8),
    "friction": (0.05, 0.8),
    "height": (0.03, 0.5),
    "speed": (0.0, 1.5),
    "spin": (0.0, 50.0),
}
"""Parameters that are fitted with their limits, in the units of `Table`. The prior is flat there.
Dice that are larger than the least height are dropped from higher."""

FIRST: Final = 0.5
"""Part of the evaluations that are spread over all throws; the others are where the posterior is
after the first, in `ROUNDS` rounds."""

ROUNDS: Final = 4

SHARPNESS: Final = 8
"""The fitted set is the mean of the posterior raised to this power: near the likeliest set where
the counts tell, and in the middle where they do not."""

FEWEST_EVALUATIONS: Final = 32

GRID: Final = 2**16
"""Points at which the posterior is computed, of a low-discrepancy sequence."""

KEPT: Final = 2**14
"""The likeliest of them, for which the surrogate's uncertainty is looked at, too."""

BELIEF: Final = 0.9
"""Posterior probability of the interval of each parameter."""

COUNTS: Final = "counts"
"""Rows of a checkpoint: what came up with each die for each set of parameters."""


@dataclass(frozen=True)
class FittedParameter:
    """One throw parameter by the counts, in the unit of `Table`.

    Attributes
    ----------
    fitted: its value in the fitted set.
    mean, deviation: of the posterior.
    interval: that holds it with the posterior probability `BELIEF`, as much below as above.
    limits: of the search, between which the prior is flat.
    """

    fitted: float
    mean: float
    deviation: float
    interval: tuple[float, float]
    limits: tuple[float, float]


@dataclass(frozen=True)
class TableFit:
    """A fitted table with its uncertainty.

    Attributes
    ----------
    table: the fitted set of parameters, to three digits (see `SHARPNESS`).
    parameters: each of `PARAMETERS`, in that order.
    correlations: (5, 5) of the posterior.
    evaluations: sets of parameters that were simulated; drops: of each die for each set.
    log_likelihood: of the counts of all dice at `table`, by the surrogate, less what frequencies
        equal to the odds would give.
    surprise: root mean square deviation of simulated log odds from what the surrogate predicts
        without them, in standard deviations: near 1 if it is right about its uncertainty.
    effective_points: of the points at which the posterior was computed, how many equal ones would
        be as good.
    """

    table: Table
    parameters: dict[str, FittedParameter]
    correlations: Floats
    evaluations: int
    drops: int
    log_likelihood: float
    surprise: float
    effective_points: float


@dataclass(frozen=True)
class _Posterior:
    """points: (n, 5) of the unit cube; weights: (n,), summing to 1."""

    points: Floats
    weights: Floats


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
    workers: Executor,
    checkpoint: Checkpoint | None = None,
    progress: Callable[[int], None] | None = None,
) -> TableFit:
    """Fit restitution, friction, height, speed and spin to what came up.

    Sets of parameters are simulated, first all over the search's limits and then where the
    posterior is. Through the simulated odds of every die goes a smooth surrogate, which averages
    over the sampling noise of neighbouring sets; the likelihood of the real counts is computed
    from its odds and its own uncertainty, for a dense set of points. Each set has random numbers of
    its own. Common ones would make the noise of neighbouring sets the same only if the same drop
    ended alike in both, but bounces part them: of the published 2d6, let go alike, 12 % end on the
    same rest when the restitution differs by a thousandth, and 12 % by chance.

    Parameters
    ----------
    start: has the name, and the size of dice whose size is unknown.
    evaluations: sets of parameters, at least `FEWEST_EVALUATIONS`. drops: of each die, above 0.
    seed: of the drops and of the sets.
    checkpoint: of the same arguments; what was simulated before is taken from it, and what is
        simulated is added.
    progress: called with the number of drops of each die that was thrown.

    Raises InputError: as `check_effort`.
    """
    check_effort(evaluations, drops, seed)
    kept = checkpoint or Checkpoint()
    limits = _limits(dice, start)
    first = round(FIRST * evaluations)
    rng = np.random.default_rng(seed)
    sequence = qmc.Sobol(len(PARAMETERS), rng=rng)
    points = sequence.random_base2((first - 1).bit_length())[:first]
    counts = _simulated(dice, start, limits, points, drops, seed, 0, workers, kept, progress)
    grid = qmc.Sobol(len(PARAMETERS), rng=rng).random_base2(GRID.bit_length() - 1)
    for batch in np.array_split(np.arange(first, evaluations), ROUNDS):
        posterior = _posterior(_surrogates(points, counts), dice, grid)
        drawn = rng.choice(len(posterior.points), len(batch), p=posterior.weights)
        more = posterior.points[drawn]
        done = len(points)
        added = _simulated(dice, start, limits, more, drops, seed, done, workers, kept, progress)
        points = np.concatenate([points, more])
        counts = [np.concatenate(pair) for pair in zip(counts, added, strict=True)]
    surrogates = _surrogates(points, counts)
    posterior = _posterior(surrogates, dice, grid)
    parameters, correlations = _summary(posterior, limits)
    fitted = {name: entry.fitted for name, entry in parameters.items()}
    place = [[(fitted[name] - least) / (most - least) for name, (least, most) in limits.items()]]
    surprises = [p.surprises() for surrogate in surrogates for p in surrogate.processes]
    return TableFit(
        table=_table(start, fitted),
        parameters=parameters,
        correlations=correlations,
        evaluations=evaluations,
        drops=drops,
        log_likelihood=float(_log_likelihood(surrogates, dice, np.array(place), True)[0]),
        surprise=float(np.sqrt(np.square(np.concatenate(surprises)).mean())),
        effective_points=float(1.0 / np.square(posterior.weights).sum()),
    )


def _summary(
    posterior: _Posterior, limits: Mapping[str, tuple[float, float]]
) -> tuple[dict[str, FittedParameter], Floats]:
    """The parameters, and their correlations (5, 5)."""
    weights = posterior.weights
    sharp = weights**SHARPNESS / np.sum(weights**SHARPNESS)
    least, most = np.array(list(limits.values())).T
    values = least + (most - least) * posterior.points
    # No counts determine more digits than these.
    best = [float(f"{value:.3g}") for value in sharp @ values]
    means = weights @ values
    deviations = np.sqrt(weights @ (values - means) ** 2)
    scaled = (values - means) / deviations
    parameters = {}
    for i, (name, searched) in enumerate(limits.items()):
        order = np.argsort(values[:, i])
        tail = (1.0 - BELIEF) / 2.0
        at = np.searchsorted(weights[order].cumsum(), [tail, 1.0 - tail])
        low, high = values[order[np.minimum(at, len(order) - 1)], i].tolist()
        parameters[name] = FittedParameter(
            best[i], float(means[i]), float(deviations[i]), (low, high), searched
        )
    return parameters, scaled.T @ (weights[:, None] * scaled)


def _surrogates(points: Floats, counts: Sequence[Integers]) -> list[OddsSurrogate]:
    return [OddsSurrogate.through(points, of_die) for of_die in counts]


def _posterior(
    surrogates: Sequence[OddsSurrogate], dice: Sequence[CountedDie], grid: Floats
) -> _Posterior:
    """The posterior at the likeliest points of the grid (n, 5), by the flat prior."""
    points = grid[np.argsort(_log_likelihood(surrogates, dice, grid, False))[-KEPT:]]
    exact = _log_likelihood(surrogates, dice, points, True)
    weights = np.exp(exact - exact.max())
    return _Posterior(points, weights / weights.sum())


def _log_likelihood(
    surrogates: Sequence[OddsSurrogate], dice: Sequence[CountedDie], points: Floats, exact: bool
) -> Floats:
    """(n,) of all counts, at points (n, 5), as `OddsSurrogate.log_likelihood`."""
    parts = [
        surrogate.log_likelihood(points, die.counts, exact)
        for surrogate, die in zip(surrogates, dice, strict=True)
    ]
    return np.sum(parts, axis=0)


def _simulated(
    dice: Sequence[CountedDie],
    start: Table,
    limits: Mapping[str, tuple[float, float]],
    points: Floats,
    drops: int,
    seed: int,
    first: int,
    workers: Executor,
    checkpoint: Checkpoint,
    progress: Callable[[int], None] | None,
) -> list[Integers]:
    """Counts (n, g) of each die, thrown at n points of the unit cube.

    first: number of the first of the points among all, which makes their seeds.
    """
    tasks = []
    for number, point in enumerate(points.tolist(), start=first):
        values = {
            name: least + (most - least) * x
            for (name, (least, most)), x in zip(limits.items(), point, strict=True)
        }
        table = _table(start, values)
        tasks += [
            partial(outcome_counts, die, table, drops, (seed, number, i))
            for i, die in enumerate(dice)
        ]
    begun = first * len(dice)
    known = list(checkpoint.rows(COUNTS)[begun : begun + len(tasks)])
    counts: list[list[Integers]] = [[] for _ in dice]
    for place, came in enumerate(chain(known, in_order(tasks[len(known) :], workers))):
        die = place % len(dice)
        if place >= len(known):
            checkpoint.add(COUNTS, [came])
        checkpoint.require(len(came) == len(dice[die].labels))
        counts[die].append(came)
        if progress is not None:
            progress(drops)
    return [np.array(rows, dtype=np.int64) for rows in counts]


def _table(start: Table, values: Mapping[str, float]) -> Table:
    return Table(**{**start.as_dict(), **values})


def _limits(dice: Sequence[CountedDie], start: Table) -> dict[str, tuple[float, float]]:
    """Those of `PARAMETERS`, for dice of these sizes."""
    largest = max(start.size if die.size is None else die.size for die in dice)
    least, most = PARAMETERS["height"]
    return {**PARAMETERS, "height": (max(least, largest), max(most, 2.0 * largest))}


def outcome_counts(die: CountedDie, table: Table, drops: int, seed: Sequence[int]) -> Integers:
    """Counts (g,) of a die's outcomes on a table.

    drops: how often it is thrown; seed: one of several numbers, from which different ones are
    unrelated.
    """
    (own,) = np.random.SeedSequence(seed).generate_state(1).tolist()
    return die.by_outcome(simulate(die.body, table.sized(die.size), drops, own).counts)
