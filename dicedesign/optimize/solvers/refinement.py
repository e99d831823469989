"""Design against simulated throws: what the momentum model gets wrong of a die is measured, and the
die designed again for probabilities that make up for it.

The model's probabilities m of a die and its probabilities when thrown differ by a factor exp(b)
that changes little from one die to the next, and from the table that is meant to others that may be
meant. So b is learned from the throws of all dice so far, on all tables (`Bias`), and the model is
asked for `q exp(-b)` in place of the target q. Once all that is learned no longer makes a die
better by as much as is not known of it, no more is thrown.

Every die has its probabilities estimated by what all throws say of it, which shrinks its own lucky
ones; that of the thrown dice is kept which so has the least expected deviation. None is kept that
was never thrown. The throws that made the choice flatter it all the same, so that the verdict over
a die is left to others.

After the first round the die is designed to have the same probabilities on all tables; in the later
ones it is no more made better by preference: one that hardly moves keeps what was measured of
    it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.optimize.options import MOST_DROPS
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.results.parts import RoundOfThrows
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.bias import OFTEN, Bias, expected_variation
from dicedesign.throws.distances import noise_floor, total_variation


def shape_measures(die: DesignResult, center: Floats | None) -> Floats:
    """(4 k,) of a die that change by little from one to the next near it: normals of the outcomes'
    facets, and logarithms of their distances from the center of mass over the mean of these.

    center: (3,) of mass, or None for the uniform solid.
    """
    hull = die.hull
    facets = np.argmax(die.directions @ hull.normals.T, axis=1)
    distances = hull.depths(hull.centroid if center is None else center)[facets]
    return np.concatenate([hull.normals[facets].ravel(), np.log(distances / distances.mean())])


COMMON: Final = 0.4
"""Standard deviation of the logarithm of an outcome's probabilities over those in the model."""

BY_TABLE: Final = (0.01, 0.03, 0.1)
"""The same of its change with each measure of the table, in units of how much that varies: guesses.
"""

BY_SHAPE: Final = ((0.2, 0.02), (0.2, 0.05), (0.8, 0.02), (0.8, 0.1))
"""The same of its change with each measure of the die, and of what is each die's own: guesses."""


ON_TABLES: Final = 0.5
"""Throws onto the other tables, all together, over those onto the one that is meant."""

TELLING: Final = 1.5
"""Throws onto the other tables that tell how a die's probabilities change, over those of the first
round."""

LEAST_GROWTH: Final = 0.25
"""Throws of a round over those of all before, unless it is as many as those of the first."""

AIM: Final = 0.65
"""Expected deviation over the one that counts as reached, from which on no more is thrown."""

TRIED: Final = 4
"""Throws of a die that ends the rounds over those of the first: one that seems right after fewer is
thrown again, as it may have been lucky."""

ENOUGH: Final = 0.7
"""The same with the other tables, from which on the die is made no better."""

LOOSER: Final = 2.0
"""Deviation that counts as reached there, over that on the table that is meant."""

MOST_TURNS: Final = 4
"""Designs of one round."""

FARTHEST: Final = 1.0
"""Longest step of a later design over that of the first one."""

EXACT: Final = 0.1
"""Deviation that is left of what is known, over the one that counts as reached."""

MOST_HALVINGS: Final = 4
"""How often a correction for which no die is found is halved."""


@dataclass(frozen=True)
class Thrown:
    """Throws of one die onto one table.

    Attributes
    ----------
    counts: (k + 1,) of the outcomes, and of throws that ended on none. probabilities: (k,) in the
        model.
    """

    counts: Integers
    probabilities: Floats


@dataclass(frozen=True)
class Refinement:
    """Rounds of throwing a die and designing it again.

    Attributes
    ----------
    target: (k,) wanted probabilities of the outcomes.
    orbits: (k,) a number for each outcome, the same for those whose facets are images of each other
        by a symmetry of the die: they are equally frequent but for chance.
    tables: (t, d) measures of the other tables on which the die shall be right too, 0 for the one
        that is meant, in units of how much each varies.
    drops: throws of the first round. rounds: most rounds.
    within: total variation that counts as reached.
    throw: throws of a die onto the table that is meant, so many, in a series of this number, first
        that of a round; all have random numbers of their own.
    throw_on_tables: the same onto each of the tables (t,), so many onto each.
    design: from a die to one near it with other probabilities (k,) in the model, or None; also told
        the logarithms (t, k) of the probabilities on the tables over those in the model, or None
        where it shall be nearest and no better by preference.
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
    on_round: Callable[[RoundOfThrows], None] | None = None

    def refine(self, die: DesignResult) -> tuple[DesignResult, tuple[RoundOfThrows, ...]]:
        """The best of the dice that the rounds lead to, from one whose probabilities in the model
        are the target, and the rounds, the last of which is the last die's. There are none where
        symmetry makes a die right."""
        if len(np.unique(self.orbits)) == 1:
            return die, ()
        known = _KnownProbabilities(self, self.measures(die), self.rounds)
        target, dice, total_throws, own, least = self.target, list[_Trial](), 0, 0, self.drops

        def best_of_all() -> _Trial:
            return min(dice, key=lambda one: self._shortfall(known, one))

        for number in range(self.rounds):
            # What is needed, were all throws of one die, until what is not known of it is below
            # what ends the rounds; at least a part of those so far, as they are not.
            floor = noise_floor(np.bincount(self.orbits, self.target), max(total_throws, 1))
            enough = total_throws * (floor / (AIM * self.within)) ** 2
            lacking = math.ceil(max(enough - total_throws, LEAST_GROWTH * total_throws))
            drops = min(max(least, min(total_throws, lacking)), MOST_DROPS)
            each = math.ceil(ON_TABLES * drops / max(len(self.tables), 1))
            thrown = self._throw(die, drops, each, number)
            trial = _Trial(die, target, self.measures(die), own, thrown)
            known.learn(trial)
            dice.append(trial)
            total_throws += drops
            if self.on_round is not None:
                self.on_round(self._round(known, trial))
            is_right = known.variations(trial)[0] / self.within <= AIM
            is_steady = number > 0 or self._shortfall(known, trial) <= ENOUGH
            best = best_of_all()
            tried = sum(one.thrown[0].counts.sum() for one in dice if one.number == best.number)
            is_over, enough = is_right and is_steady, TRIED * self.drops
            if (is_over and tried >= enough) or number == self.rounds - 1:
                break
            if is_over:
                die, target, own, least = best.die, best.wanted, best.number, enough
                continue
            improved = self._correct(known, trial, is_making=number == 0)
            if improved is None:
                break
            (die, target), own, least = improved, number + 1, self.drops
        best = best_of_all()
        return best.die, tuple(self._round(known, one, one is best) for one in dice)

    def swing(self, die: DesignResult, place: int) -> float:
        """Total variation between a die's probabilities on the target table and on the others, for
        nine in ten of these, by throws numbered `place` after those of all rounds."""
        shape, drops = self.measures(die), math.ceil(self.drops / 2)
        each = math.ceil(TELLING * self.drops / len(self.tables))
        thrown = self._throw(die, drops, each, self.rounds + place)
        known = _KnownProbabilities(self, shape, 1)
        known.learn(_Trial(die, self.target, shape, 0, thrown))
        logarithms = known.logarithms(shape, 0, self.places)
        probabilities = [
            one.probabilities * np.exp(row) for one, row in zip(thrown, logarithms, strict=True)
        ]
        own, *changed = (row / row.sum() for row in probabilities)
        return float(np.quantile([total_variation(row, own) for row in changed], OFTEN))

    @property
    def places(self) -> Floats:
        """(1 + t, d) measures of the table that is meant, all 0, and of the others."""
        return np.pad(self.tables, ((1, 0), (0, 0)))

    def _throw(self, die: DesignResult, drops: int, each: int, number: int) -> list[Thrown]:
        """A die thrown so often onto the table that is meant, and onto each of the others."""
        others = self.throw_on_tables(die, each, number) if len(self.tables) else []
        return [self.throw(die, drops, number), *others]

    def _round(
        self, known: _KnownProbabilities, trial: _Trial, is_kept: bool = False
    ) -> RoundOfThrows:
        counts, *others = (one.counts for one in trial.thrown)
        drops, (on_table, elsewhere) = int(counts.sum()), self._expect(known, trial)
        return RoundOfThrows(
            drops=drops,
            deviation=total_variation(counts / drops, np.append(self.target, 0.0)),
            noise_floor=noise_floor(self.target, drops),
            expected=on_table,
            elsewhere_drops=sum(int(one.sum()) for one in others),
            elsewhere=elsewhere,
            is_kept=is_kept,
            requested=tuple(trial.wanted.tolist()),
            frequencies=tuple((counts[:-1] / drops).tolist()),
        )

    def _expect(self, known: _KnownProbabilities, trial: _Trial) -> tuple[float, float | None]:
        """See `RoundOfThrows`: on the table that is meant, and elsewhere."""
        on_table, *others = known.variations(trial)
        return on_table, float(np.quantile(others, OFTEN)) if others else None

    def _shortfall(self, known: _KnownProbabilities, trial: _Trial) -> float:
        """The expected deviation of a die over what counts as reached: that on the table that is
        meant, or the mean of that and of that on the others."""
        on_table, elsewhere = self._expect(known, trial)
        on_table /= self.within
        return (
            on_table if elsewhere is None else (on_table + elsewhere / (LOOSER * self.within)) / 2.0
        )

    def _correct(
        self, known: _KnownProbabilities, trial: _Trial, is_making: bool
    ) -> tuple[DesignResult, Floats] | None:
        """A die that makes up for what is known, and its probabilities in the model.

        What the model gets wrong changes from the die that was thrown to the new one, as far as
        that is known; so the probabilities that are asked for are a fixed point, found by
        Anderson's method.
        """
        targets, lacking = [np.log(trial.wanted)], list[Floats]()
        result, shape = None, trial.shape
        number: int | None = trial.number
        for turn in range(MOST_TURNS):
            wanted = np.log(self.target) - known.logarithms(shape, number, self.places[0])
            lacking.append(wanted - targets[-1])
            if turn > 0 and np.abs(self.target * lacking[-1]).sum() / 2.0 < EXACT * self.within:
                break
            sensitivity = None
            if is_making and turn == 0:
                sensitivity = known.logarithms(shape, number, self.tables)
            die, again = trial.die if result is None else result[0], None
            wanted = _mix(targets, lacking)
            # Where none is found but one is needed, a die goes a part of the way.
            for halving in range(MOST_HALVINGS if turn == 0 else 1):
                part = 0.5**halving
                probabilities = np.exp(part * wanted + (1.0 - part) * targets[-1])
                probabilities /= probabilities.sum()
                again = self.design(die, probabilities, sensitivity)
                if again is not None:
                    break
            if again is None:
                break
            result = again, probabilities
            targets.append(np.log(probabilities))
            shape, number = self.measures(again), None
        return result


def _mix(points: list[Floats], steps: list[Floats]) -> Floats:
    """The next point (k,) of a fixed point's search, from points (k,) so far and the steps (k,)
    that lead from each to its image.

    Source: Walker and Ni, SIAM Journal on Numerical Analysis 49(4), 2011, algorithm AA.
    """
    if len(points) == 1:
        return points[0] + steps[0]
    changes = np.diff(steps, axis=0).T
    moves = np.diff(points, axis=0).T
    weights = np.linalg.lstsq(changes, steps[-1], rcond=None)[0]
    step = steps[-1] - (moves + changes) @ weights
    length, farthest = float(np.linalg.norm(step)), FARTHEST * float(np.linalg.norm(steps[0]))
    mixed: Floats = points[-1] + step * min(1.0, farthest / length if length > 0.0 else 1.0)
    return mixed


@dataclass(frozen=True)
class _Trial:
    """A die that was thrown first in a round of this number, with its measures (f,), onto the table
    that is meant and others."""

    die: DesignResult
    wanted: Floats
    shape: Floats
    number: int
    thrown: list[Thrown]


class _KnownProbabilities:
    """Estimates, from throws, of dice's probabilities over the model's, by orbits of outcomes."""

    def __init__(self, refinement: Refinement, first: Floats, dice: int) -> None:
        """Start without throws, for at most a number of dice, with measures as those of the first
        (f,)."""
        sizes = [1, refinement.tables.shape[1], len(first), dice]
        deviations = [
            np.repeat([COMMON, by_table, by_shape, own], sizes)
            for by_table in BY_TABLE
            for by_shape, own in BY_SHAPE
        ]
        self.bias = Bias(np.array(deviations))
        self.first, self.dice = first, dice
        self.target, self.orbits = refinement.target, refinement.orbits
        self.places = refinement.places

    def learn(self, trial: _Trial) -> None:
        """Take note of throws."""
        for place, one in zip(self.places, trial.thrown, strict=True):
            counts = np.rint(self._by_orbit(one.counts[:-1])).astype(np.int64)
            features = self._features(trial.shape, trial.number, place)
            self.bias.learn(features, self._by_orbit(one.probabilities), counts)

    def logarithms(self, shape: Floats, number: int | None, table: Floats) -> Floats:
        """(..., k) of the outcomes' probabilities over those in the model on tables (..., d); of a
        die that was thrown, or of another for None."""
        return self.bias.logarithms(self._features(shape, number, table))[..., self.orbits]

    def variations(self, trial: _Trial) -> list[float]:
        """Total variation from the target that is to be expected of a die that was thrown, on each
        table."""
        return [
            expected_variation(
                self.bias.estimate(
                    self._features(trial.shape, trial.number, place),
                    self._by_orbit(one.probabilities),
                ),
                self._by_orbit(self.target),
            )
            for place, one in zip(self.places, trial.thrown, strict=True)
        ]

    def _by_orbit(self, values: Floats | Integers) -> Floats:
        sums: Floats = np.bincount(self.orbits, values).astype(np.float64)
        return sums

    def _features(self, shape: Floats, number: int | None, table: Floats) -> Floats:
        """(..., 1 + d + f + n) what the bias depends on."""
        own = np.arange(self.dice) == (-1 if number is None else number)
        of_die = np.concatenate([shape - self.first, own])
        ones = np.ones((*table.shape[:-1], 1))
        rows = np.broadcast_to(of_die, (*table.shape[:-1], len(of_die)))
        return np.concatenate([ones, table, rows], axis=-1)
