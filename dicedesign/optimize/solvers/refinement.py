"""Refinement of a die by simulated throws: they measure the error of the momentum model, and the
die is designed again for probabilities that compensate it.

A die is thrown onto the tables of a mixture in turn; one table is a mixture of itself. The
probabilities m of a die in the model and its probabilities when thrown differ by a factor exp(b)
that changes little between similar dice and tables. So b is learned from the throws of all dice so
far, on all tables (`Bias`), and the next die has the probabilities `q exp(-b)` in the model instead
of the target q, on the mean of the tables. Rounds end when the uncertainty of what is known exceeds
what a better die would gain.

The estimate of each die uses all throws, which corrects for its own luck. The thrown die with the
least expected deviation is kept. As the throws that chose a die still flatter it, other throws must
judge it.

After the first round the die is improved by preferences again. Later rounds do not, so that it
moves little and stays similar to what was measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dicedesign.optimize.options import MOST_DROPS
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.results.parts import RoundOfThrows
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.bias import Bias, Estimate, expected_variation
from dicedesign.throws.distances import noise_floor, total_variation


def shape_measures(die: DesignResult, center: Floats | None) -> Floats:
    """Measures (4 k,) of a die that change little between similar dice: normals of the outcomes'
    facets, and logarithms of their distances from the center of mass over the mean of these.

    center: (3,) center of mass, or None for the uniform solid.
    """
    hull = die.hull
    facets = np.argmax(die.directions @ hull.normals.T, axis=1)
    distances = hull.depths(hull.centroid if center is None else center)[facets]
    return np.concatenate([hull.normals[facets].ravel(), np.log(distances / distances.mean())])


COMMON = 0.4
"""Prior standard deviation of the logarithm of an outcome's probability over that in the model."""

BY_TABLE = (0.01, 0.03, 0.1)
"""Candidates for the standard deviation of its change with each measure of the table."""

BY_SHAPE = ((0.2, 0.02), (0.2, 0.05), (0.8, 0.02), (0.8, 0.1))
"""Candidates for the standard deviations of its change with each measure of the die, and of the
part that is independent for each die."""

LEAST_GROWTH = 0.25
"""Least number of throws of a round, per throw of all rounds before."""

AIM = 0.65
"""Expected deviation that ends the rounds, over `within`."""

TRIED = 4
"""Throws of the die that ends the rounds, per throw of the first round; after fewer it may only be
lucky."""

MOST_TURNS = 4
"""Limit on the designs of one round."""

FARTHEST = 1.0
"""Longest step of a later design, over the step of the first one."""

EXACT = 0.1
"""Known deviation that a design may leave, over `within`."""

MOST_HALVINGS = 4
"""Limit on how often a correction without a die is halved."""


@dataclass(frozen=True)
class Thrown:
    """Throws of one die onto t tables.

    Attributes
    ----------
    counts: (t, k + 1) of the outcomes, and of throws without an outcome.
    probabilities: (t, k) in the model of each table.
    model: (k,) in the model of their mixture, by which dice are designed.
    """

    counts: Integers
    probabilities: Floats
    model: Floats


@dataclass(frozen=True)
class Refinement:
    """Rounds of throwing a die and designing it again.

    Attributes
    ----------
    target: (k,) target probabilities of the outcomes.
    orbits: (k,) number of the orbit of each outcome. Outcomes whose facets are images of each other
        by a symmetry of the die are equally probable.
    tables: (t, d) measures of the tables, relative to their mean and in units of how much each
        varies.
    drops: throws of the first round. rounds: limit on the rounds.
    within: total variation that suffices.
    throw: throws a die; arguments are the die, the number of throws and the number of the series,
        each with its own random numbers.
    design: designs a die near a given one with probabilities (k,) in the model, or returns None.
        Its third argument says whether to improve it by preferences.
    measures: measures (f,) of a die that change little between similar dice.
    on_round: called after every round of throws.
    """

    target: Floats
    orbits: Integers
    tables: Floats
    drops: int
    rounds: int
    within: float
    throw: Callable[[DesignResult, int, int], Thrown]
    design: Callable[[DesignResult, Floats, bool], DesignResult | None]
    measures: Callable[[DesignResult], Floats]
    on_round: Callable[[RoundOfThrows], None] | None = None

    def refine(self, die: DesignResult) -> tuple[DesignResult, tuple[RoundOfThrows, ...]]:
        """Refine a die whose probabilities in the model are the target. Returns the best die of the
        rounds, and the rounds; there are none if symmetry makes the die right."""
        if len(np.unique(self.orbits)) == 1:
            return die, ()
        known = _Trials(self, self.measures(die))
        target, total_throws, own, least = self.target, 0, 0, self.drops
        for number in range(self.rounds):
            # Throws of one die that reduce the uncertainty to the aim; at least a part of all
            # throws so far, as these are of several dice.
            floor = noise_floor(np.bincount(self.orbits, self.target), max(total_throws, 1))
            enough = total_throws * (floor / (AIM * self.within)) ** 2
            missing = math.ceil(max(enough - total_throws, LEAST_GROWTH * total_throws))
            drops = min(max(least, min(total_throws, missing)), MOST_DROPS)
            trial = known.throw(die, target, own, (drops, number))
            total_throws += drops
            if self.on_round is not None:
                self.on_round(known.summarize(trial))
            is_right = known.variation(trial) / self.within <= AIM
            best = known.best
            tried = sum(
                one.thrown.counts.sum() for one in known.trials if one.number == best.number
            )
            enough = TRIED * self.drops
            if (is_right and tried >= enough) or number == self.rounds - 1:
                break
            if is_right:
                die, target, own, least = best.die, best.wanted, best.number, enough
                continue
            improved = known.correct(trial, is_first=number == 0)
            if improved is None:
                break
            (die, target), own, least = improved, number + 1, self.drops
        best = known.best
        return best.die, tuple(known.summarize(one, one is best) for one in known.trials)


@dataclass(frozen=True)
class _Trial:
    """A thrown die with its measures (f,).

    Attributes
    ----------
    wanted: (k,) its probabilities in the model.
    number: number of the round in which it was thrown first.
    """

    die: DesignResult
    wanted: Floats
    shape: Floats
    number: int
    thrown: Thrown


class _Trials:
    """Thrown dice, and estimates of the probabilities of dice over those in the model, by orbits of
    outcomes."""

    def __init__(self, refinement: Refinement, first: Floats) -> None:
        """Start without throws. first: measures (f,) of the first die."""
        sizes = [1, refinement.tables.shape[1], len(first), refinement.rounds]
        deviations = [
            np.repeat([COMMON, by_table, by_shape, own], sizes)
            for by_table in BY_TABLE
            for by_shape, own in BY_SHAPE
        ]
        self.bias = Bias(np.array(deviations))
        self.refinement, self.first = refinement, first
        self.trials: list[_Trial] = []

    def throw(
        self, die: DesignResult, wanted: Floats, number: int, series: tuple[int, int]
    ) -> _Trial:
        """Throw a die, and learn from its throws. series: throws, and the number of the series."""
        thrown = self.refinement.throw(die, *series)
        trial = _Trial(die, wanted, self.refinement.measures(die), number, thrown)
        counts = np.rint(self._by_orbit(thrown.counts[:, :-1])).astype(np.int64)
        features = self._features(trial.shape, number)
        for row in zip(features, self._by_orbit(thrown.probabilities), counts, strict=True):
            self.bias.learn(*row)
        self.trials.append(trial)
        return trial

    @property
    def best(self) -> _Trial:
        """Trial of the least expected deviation."""
        return min(self.trials, key=self.variation)

    def logarithms(self, trial: _Trial, shape: Floats, number: int | None) -> Floats:
        """Logarithms (k,) of the probabilities of outcomes on the mixture over those in its model,
        where these are as for a trial.

        shape: measures (f,) of a die; number: of a thrown die, or None for another die.
        """
        by_table = self.bias.logarithms(self._features(shape, number))[:, self.refinement.orbits]
        parts = trial.thrown.probabilities * np.exp(by_table)
        logarithms: Floats = np.log(parts.mean(axis=0) / trial.thrown.model)
        return logarithms

    def estimate(self, trial: _Trial) -> Estimate:
        """Estimated probabilities of the orbits of a thrown die on the mixture."""
        model = self._by_orbit(trial.thrown.probabilities)
        return self.bias.estimate(self._features(trial.shape, trial.number), model)

    def variation(self, trial: _Trial) -> float:
        """Expected total variation from the target, of a thrown die on the mixture."""
        return expected_variation(self.estimate(trial), self._by_orbit(self.refinement.target))

    def summarize(self, trial: _Trial, is_kept: bool = False) -> RoundOfThrows:
        """Summary of a round."""
        counts, target = trial.thrown.counts.sum(axis=0), self.refinement.target
        drops = int(counts.sum())
        return RoundOfThrows(
            drops=drops,
            deviation=total_variation(counts / drops, np.append(target, 0.0)),
            noise_floor=noise_floor(target, drops),
            expected=self.variation(trial),
            is_kept=is_kept,
            requested=tuple(trial.wanted.tolist()),
            frequencies=tuple((counts[:-1] / drops).tolist()),
        )

    def correct(self, trial: _Trial, is_first: bool) -> tuple[DesignResult, Floats] | None:
        """Design a die that compensates the known error of the model. Returns it and its
        probabilities in the model, or None.

        The error changes from the thrown die to the new one, as far as that is known. So these
        probabilities are a fixed point, which is found by Anderson acceleration.
        """
        target, within = self.refinement.target, self.refinement.within
        targets, lacking = [np.log(trial.wanted)], list[Floats]()
        result, shape = None, trial.shape
        number: int | None = trial.number
        for turn in range(MOST_TURNS):
            wanted = np.log(target) - self.logarithms(trial, shape, number)
            lacking.append(wanted - targets[-1])
            if turn > 0 and np.abs(target * lacking[-1]).sum() / 2.0 < EXACT * within:
                break
            die, designed = trial.die if result is None else result[0], None
            wanted = _mix(targets, lacking)
            # Without a die, try a part of the way; only the first turn needs one.
            for halving in range(MOST_HALVINGS if turn == 0 else 1):
                part = 0.5**halving
                probabilities = np.exp(part * wanted + (1.0 - part) * targets[-1])
                probabilities /= probabilities.sum()
                designed = self.refinement.design(die, probabilities, is_first and turn == 0)
                if designed is not None:
                    break
            if designed is None:
                break
            result = designed, probabilities
            targets.append(np.log(probabilities))
            shape, number = self.refinement.measures(designed), None
        return result

    def _by_orbit(self, values: Floats | Integers) -> Floats:
        """(..., o) sums of values (..., k) by orbits."""
        orbits = self.refinement.orbits
        sums: Floats = values @ np.eye(orbits.max() + 1)[orbits]
        return sums

    def _features(self, shape: Floats, number: int | None) -> Floats:
        """(t, 1 + d + f + n) features of the bias on each table."""
        tables = self.refinement.tables
        own = np.arange(self.refinement.rounds) == (-1 if number is None else number)
        of_die = np.concatenate([shape - self.first, own])
        ones, rows = np.ones((len(tables), 1)), np.tile(of_die, (len(tables), 1))
        return np.concatenate([ones, tables, rows], axis=1)


def _mix(points: list[Floats], steps: list[Floats]) -> Floats:
    """Next point (k,) of a fixed-point iteration, from the points (k,) so far and the steps (k,)
    from these to their images.

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
