"""What a second die, or a wall, does to the odds of a die."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from dicedesign.bench.measures.throws.meetings import BESIDE, Companies, Meeting, meet
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.executors import in_order
from dicedesign.throws.counts.throw_counts import CountedDie
from dicedesign.throws.release import released
from dicedesign.throws.tables import Table

__all__ = [
    "THROWS_PER_TASK",
    "CompanyOdds",
    "Pairs",
    "compare",
    "odds_in_company",
    "thrown_at_wall",
    "thrown_together",
]

THROWS_PER_TASK: Final = 200
"""That share a generator of random numbers."""


@dataclass(frozen=True)
class Pairs:
    """Two dice thrown at once; alone: the rests (n, 2) of each thrown alone in the same way. Dice
    that did not touch are not thrown again: they end as they did in company, of which they knew
    nothing."""

    meeting: Meeting
    alone: Integers


def thrown_together(die: CountedDie, table: Table, count: int, seed: Sequence[int]) -> Pairs:
    """So many throws of two dice at once."""
    rng = np.random.default_rng(seed)
    states = released(die.body, table, np.arange(2 * count), "uniform", rng).reshape(count, 2, 13)
    beside = states.copy()
    beside[:, 1, 1] += BESIDE * table.size
    meeting = meet(die.body, table, beside, "die")
    alone = meeting.rests.copy()
    again = np.flatnonzero(meeting.touched)
    flat = states[again].reshape(-1, 1, 13)
    alone[again] = meet(die.body, table, flat, None).rests.reshape(-1, 2)
    return Pairs(meeting, alone)


def thrown_at_wall(die: CountedDie, table: Table, count: int, seed: Sequence[int]) -> Meeting:
    """So many throws of one die towards a wall."""
    rng = np.random.default_rng(seed)
    states = released(die.body, table, np.arange(count), "uniform", rng)
    return meet(die.body, table, states[:, None], "wall")


@dataclass(frozen=True)
class CompanyOdds:
    """What company does to the odds of one die.

    Attributes
    ----------
    throws: of the die in company. touched: part of them that met it.
    lost: part of them that ended on no facet; lost_alone: the same without company.
    changes: (g,) of the odds of its outcomes, with the sum 0. covariance: (g, g) of their errors.
    """

    throws: int
    touched: float
    lost: float
    lost_alone: float
    changes: Floats
    covariance: Floats

    @property
    def errors(self) -> Floats:
        """(g,) standard errors of the changes."""
        errors: Floats = np.sqrt(np.diag(self.covariance))
        return errors

    @property
    def p_value(self) -> float:
        """Of changes as large by chance alone: chi-square on g - 1 degrees of freedom."""
        from scipy.stats import chi2

        free, covariance = self.changes[:-1], self.covariance[:-1, :-1]
        statistic = free @ np.linalg.pinv(covariance, hermitian=True) @ free
        return float(chi2.sf(statistic, len(free)))

    @property
    def total_variation(self) -> float:
        """Between the odds in company and alone."""
        return float(np.abs(self.changes).sum() / 2.0)

    @property
    def noise_floor(self) -> float:
        """Mean of it where company changes nothing."""
        return float(np.sqrt(2.0 / np.pi) * self.errors.sum() / 2.0)

    @property
    def above_noise(self) -> float:
        """Total variation less what chance adds in the square."""
        return float(np.sqrt(max(self.total_variation**2 - self.noise_floor**2, 0.0)))


def odds_in_company(
    die: CountedDie,
    table: Table,
    throws: int,
    seed: int,
    workers: Executor,
    on_throws: Callable[[int], None],
) -> dict[Companies, CompanyOdds]:
    """Throw a die so many times with a second one, two at once, and as often towards a wall, and
    compare both with throws alone. throws: a multiple of `THROWS_PER_TASK`."""
    table = table.sized(die.size)
    firsts = range(0, throws, THROWS_PER_TASK)
    pairs, at_wall = [], []
    tasks = [
        partial(thrown_together, die, table, THROWS_PER_TASK // 2, (seed, 0, k)) for k in firsts
    ]
    for pair in in_order(tasks, workers):
        pairs.append(pair)
        on_throws(THROWS_PER_TASK)
    walls = [partial(thrown_at_wall, die, table, THROWS_PER_TASK, (seed, 1, k)) for k in firsts]
    for meeting in in_order(walls, workers):
        at_wall.append(meeting)
        on_throws(THROWS_PER_TASK)
    return compare(die, pairs, at_wall)


def compare(
    die: CountedDie, pairs: Sequence[Pairs], at_wall: Sequence[Meeting]
) -> dict[Companies, CompanyOdds]:
    """What these throws say."""
    alone = _Odds.of(die, np.concatenate([pair.alone for pair in pairs]))
    together = Meeting.joined([pair.meeting for pair in pairs])
    wall = Meeting.joined(at_wall)
    beside, before = _Odds.of(die, together.rests), _Odds.of(die, wall.rests)
    # Pairs that did not touch add nothing to the difference.
    paired = _covariance(beside.residuals - alone.residuals)
    apart = _covariance(before.residuals) + _covariance(alone.residuals)
    return {
        "die": _company_odds(together, beside, alone, paired),
        "wall": _company_odds(wall, before, alone, apart),
    }


@dataclass(frozen=True)
class _Odds:
    """Odds (g,) of throws that came to rest, and how far each of n throws is from them, (n, g),
    with a mean of 0; lost: part of all dice that did not."""

    odds: Floats
    residuals: Floats
    lost: float

    @classmethod
    def of(cls, die: CountedDie, rests: Integers) -> _Odds:
        """rests: (n, d) of the d dice of each throw."""
        groups = np.append(die.group_of_rest, -1)[rests]
        came = (groups[:, :, None] == np.arange(len(die.labels))).sum(axis=1)
        shown = came.sum(axis=1, keepdims=True)
        odds = came.sum(axis=0) / shown.sum()
        return cls(odds, (came - shown * odds) / shown.mean(), float((rests < 0).mean()))


def _covariance(residuals: Floats) -> Floats:
    """(g, g) of the means of residuals (n, g)."""
    return np.asarray(np.cov(residuals, rowvar=False) / len(residuals))


def _company_odds(meeting: Meeting, met: _Odds, alone: _Odds, covariance: Floats) -> CompanyOdds:
    return CompanyOdds(
        throws=meeting.rests.size,
        touched=float(meeting.touched.mean()),
        lost=met.lost,
        lost_alone=alone.lost,
        changes=met.odds - alone.odds,
        covariance=covariance,
    )
