"""Design against simulated throws: what the momentum model gets wrong of a die is measured, and the
die designed anew for odds that make up for it.

The model's odds m of a die and its odds when thrown differ by a factor exp(b) that changes little
from one die to the next, and from the table that is meant to others that may be meant. So b is
learned from the throws of all dice so far, on all tables (`Bias`), and the model is asked for
`q exp(-b)` in place of the target q. Once all that is learned no longer makes a die better by as
much as is not known of it, no more is thrown.

Every die has its odds estimated by what all throws say of it, which shrinks its own lucky ones;
that of the thrown dice is kept which so has the least expected deviation. None is kept that was
never thrown. The throws that made the choice flatter it all the same, so that the verdict over a
die is left to others.

In the first rounds the die is designed to have the same odds on all tables; in the later ones it is
no more made better by preference: one that hardly moves keeps what was measured of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.optimize.options import MOST_DROPS
from dicedesign.optimize.result import DesignResult
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.statistics.bias import Bias, expected_variation
from dicedesign.throws.statistics.on_tables import OFTEN
from dicedesign.throws.statistics.total_variation import noise_floor, total_variation

__all__ = ["Refinement", "Round", "Thrown"]

ON_TABLES: Final = 0.5
"""Throws onto the other tables, all together, over those onto the one that is meant."""

MAKING: Final = 2
"""First rounds, after which the die is made better by preference; the later ones correct it."""

LEAST_GROWTH: Final = 0.25
"""Throws of a round over those of all before, unless it is as many as those of the first."""

AIM: Final = 0.5
"""Expected deviation over the one that counts as reached, from which on no more is thrown."""

COMMON: Final = 0.4
"""Standard deviation of the logarithm of an outcome's odds over those in the model."""

BY_TABLE: Final = (0.01, 0.04)
"""The same of its change with each measure of the table, in units of how much that varies: guesses.
"""

BY_SHAPE: Final = (0.05, 0.2, 0.8)
"""The same of its change with each measure of the die: guesses."""

LOOSER: Final = 2.0
"""Deviation that counts as reached there, over that on the table that is meant."""

MOST_HALVINGS: Final = 4
"""How often a correction for which no die is found is halved."""


@dataclass(frozen=True)
class Thrown:
    """Throws of one die onto one table.

    Attributes
    ----------
    counts: (k + 1,) of the outcomes, and of throws that ended on none. odds: (k,) in the model.
    """

    counts: Integers
    odds: Floats


@dataclass(frozen=True)
class Round:
    """Throws of one die.

    Attributes
    ----------
    asked: (k,) its odds in the model.
    drops: throws that came to rest; frequencies: (k,) of the outcomes among them, which sum to less
        than 1 where some came to rest on no outcome.
    deviation: total variation of the frequencies from the target.
    noise_floor: what a perfect die would show on the mean in as many throws.
    expected: total variation of the die's odds from the target that the throws of all rounds let
        one expect on the mean: it has what is not known of them in it.
    elsewhere_drops: throws onto the other tables, all together. elsewhere: as `expected`, on the
        table that is the worst of nine in ten; None where there are no other tables.
    is_kept: whether it is the die of this round that was kept.
    """

    asked: Floats
    drops: int
    frequencies: Floats
    deviation: float
    noise_floor: float
    expected: float
    elsewhere_drops: int = 0
    elsewhere: float | None = None
    is_kept: bool = False


@dataclass(frozen=True)
class Refinement:
    """Rounds of throwing a die and designing it anew.

    Attributes
    ----------
    target: (k,) wanted odds of the outcomes.
    orbits: (k,) a number for each outcome, the same for those whose facets are images of each other
        by a symmetry of the die: they are equally frequent but for chance.
    tables: (t, d) measures of the other tables on which the die shall be right too, 0 for the one
        that is meant, in units of how much each varies.
    drops: throws of the first round. rounds: most rounds.
    within: total variation that counts as reached.
    throw: throws of a die onto the table that is meant, so many, in a round of this number; all
        have random numbers of their own.
    throw_on_tables: the same onto each of the tables (t,), so many onto each.
    design: from a die to one near it with other odds (k,) in the model, or None; also told the
        logarithms (t, k) of the odds on the tables over those in the model, or None where it shall
        be nearest and no better by preference.
    measures: of a die (f,), that change little where the die does; as many for all.
    on_round: called after every round of throws.
    """

    target: Floats
    orbits: Integers
    tables: Floats
    drops: int
    rounds: int
    within: float
    throw: Callable[[DesignResult, int, int], Thrown]
    throw_on_tables: Callable[[DesignResult, int, int], list[Thrown]]
    design: Callable[[DesignResult, Floats, Floats | None], DesignResult | None]
    measures: Callable[[DesignResult], Floats]
    on_round: Callable[[Round], None] | None = None

    def refine(self, die: DesignResult) -> tuple[DesignResult, tuple[Round, ...]]:
        """The best of the dice that the rounds lead to, from one whose odds in the model are the
        target, and the rounds, the last of which is the last die's. There are none where symmetry
        makes a die right."""
        if len(np.unique(self.orbits)) == 1:
            return die, ()
        known = _Known.of(self, self.measures(die))
        asked, dice, seen = self.target, list[_Seen](), 0
        for number in range(self.rounds):
            drops = min(max(self.drops, min(seen, self._lacking(seen))), MOST_DROPS)
            found = self._thrown(known, die, asked, drops, number)
            dice.append(found)
            seen += drops
            if self.on_round is not None:
                self.on_round(self._round(known, found))
            # What the later rounds do not change is no reason for more.
            is_making = number < MAKING
            short = self._shortfall(known, found) if is_making else self._here(known, found)
            if short <= AIM or number == self.rounds - 1:
                break
            improved = self._corrected(known, found, is_making)
            if improved is None:
                break
            die, asked = improved
        best = min(dice, key=lambda one: self._shortfall(known, one))
        history = [replace(self._round(known, one), is_kept=one is best) for one in dice]
        return best.die, tuple(history)

    def _lacking(self, seen: int) -> int:
        """Throws that are needed beside those so far, were all of one die, until what is not known
        of it is below what ends the rounds; at least a part of those so far, as they are not."""
        floor = noise_floor(np.bincount(self.orbits, self.target), max(seen, 1))
        enough = seen * (floor / (AIM * self.within)) ** 2
        return math.ceil(max(enough - seen, LEAST_GROWTH * seen))

    def _thrown(
        self, known: _Known, die: DesignResult, asked: Floats, drops: int, number: int
    ) -> _Seen:
        """A die thrown onto all tables, of which note is taken."""
        shape = self.measures(die)
        thrown, others = self.throw(die, drops, number), list[Thrown]()
        known.learn(shape, known.meant, thrown)
        if len(self.tables):
            each = math.ceil(ON_TABLES * drops / len(self.tables))
            others = self.throw_on_tables(die, each, number)
            for table, one in zip(self.tables, others, strict=True):
                known.learn(shape, table, one)
        return _Seen(die, asked, shape, thrown, tuple(others))

    def _round(self, known: _Known, seen: _Seen) -> Round:
        counts = seen.thrown.counts
        drops = int(counts.sum())
        return Round(
            seen.asked,
            drops,
            counts[:-1] / drops,
            total_variation(counts / drops, np.append(self.target, 0.0)),
            noise_floor(self.target, drops),
            known.variation(seen.shape, known.meant, seen.thrown),
            sum(int(one.counts.sum()) for one in seen.others),
            self._elsewhere(known, seen),
        )

    def _elsewhere(self, known: _Known, seen: _Seen) -> float | None:
        """See `Round`."""
        found = [
            known.variation(seen.shape, table, one)
            for table, one in zip(self.tables, seen.others, strict=True)
        ]
        return float(np.quantile(found, OFTEN)) if found else None

    def _shortfall(self, known: _Known, seen: _Seen) -> float:
        """The expected deviation of a die over what counts as reached, on the table that is meant
        or on the others, whichever is worse."""
        here, elsewhere = self._here(known, seen), self._elsewhere(known, seen)
        return here if elsewhere is None else max(here, elsewhere / (LOOSER * self.within))

    def _here(self, known: _Known, seen: _Seen) -> float:
        """The same on the table that is meant alone."""
        return known.variation(seen.shape, known.meant, seen.thrown) / self.within

    def _corrected(
        self, known: _Known, seen: _Seen, is_making: bool
    ) -> tuple[DesignResult, Floats] | None:
        """A die that makes up for what is known, and its odds in the model; where none is found,
        one that goes a part of the way from what was asked last."""
        wanted = np.log(self.target) - known.logarithms(seen.shape, known.meant)
        sensitivity = None
        if is_making:
            sensitivity = known.logarithms(seen.shape, self.tables)
        for halving in range(MOST_HALVINGS):
            part = 0.5**halving
            odds = np.exp(part * wanted + (1.0 - part) * np.log(seen.asked))
            odds /= odds.sum()
            found = self.design(seen.die, odds, sensitivity)
            if found is not None:
                return found, odds
        return None


@dataclass(frozen=True)
class _Seen:
    """A die that was thrown, with its measures (f,), onto the table that is meant and others."""

    die: DesignResult
    asked: Floats
    shape: Floats
    thrown: Thrown
    others: tuple[Thrown, ...]


@dataclass(frozen=True)
class _Known:
    """What the throws so far say of dice, by orbit of outcomes.

    Attributes
    ----------
    first: (f,) measures of the first die. meant: (d,) of the table that is meant.
    """

    refinement: Refinement
    bias: Bias
    first: Floats
    meant: Floats

    @classmethod
    def of(cls, refinement: Refinement, first: Floats) -> _Known:
        """Nothing yet."""
        tables = refinement.tables.shape[1]
        deviations = [
            np.repeat([COMMON, by_table, by_shape], [1, tables, len(first)])
            for by_table in BY_TABLE
            for by_shape in BY_SHAPE
        ]
        return cls(refinement, Bias(np.array(deviations)), first, np.zeros(tables))

    def learn(self, shape: Floats, table: Floats, thrown: Thrown) -> None:
        """Take note of throws of a die with measures (f,) onto a table with measures (d,)."""
        odds, counts = self._by_orbit(thrown.odds), self._by_orbit(thrown.counts[:-1])
        self.bias.learn(self._features(shape, table), odds, np.rint(counts).astype(np.int64))

    def logarithms(self, shape: Floats, table: Floats) -> Floats:
        """(..., k) of the outcomes' odds over those in the model on tables (..., d)."""
        return self.bias.logarithms(self._features(shape, table))[..., self.refinement.orbits]

    def variation(self, shape: Floats, table: Floats, thrown: Thrown) -> float:
        """Total variation from the target that is to be expected."""
        belief = self.bias.belief(self._features(shape, table), self._by_orbit(thrown.odds))
        return expected_variation(belief, self._by_orbit(self.refinement.target))

    def _by_orbit(self, values: Floats | Integers) -> Floats:
        sums: Floats = np.bincount(self.refinement.orbits, values).astype(np.float64)
        return sums

    def _features(self, shape: Floats, table: Floats) -> Floats:
        """(..., 1 + d + f) what the bias depends on."""
        ones, moved = np.ones((*table.shape[:-1], 1)), shape - self.first
        rows = np.broadcast_to(moved, (*table.shape[:-1], len(moved)))
        return np.concatenate([ones, table, rows], axis=-1)
