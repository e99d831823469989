"""What throws of some dice tell of the odds of others like them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.optimize.result import DesignResult
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.bias import Bias, expected_variation


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
"""Standard deviation of the logarithm of an outcome's odds over those in the model."""

BY_TABLE: Final = (0.01, 0.03, 0.1)
"""The same of its change with each measure of the table, in units of how much that varies: guesses.
"""

BY_SHAPE: Final = ((0.2, 0.02), (0.2, 0.05), (0.8, 0.02), (0.8, 0.1))
"""The same of its change with each measure of the die, and of what is each die's own: guesses."""


@dataclass(frozen=True)
class KnownOdds:
    """What is known.

    Attributes
    ----------
    target: (k,) wanted odds. orbits: (k,) a number for each outcome, the same within an orbit.
    bias: of the orbits.
    first: (f,) measures of the first die. meant: (d,) of the table that is meant, all 0.
    dice: most dice that are thrown.
    """

    target: Floats
    orbits: Integers
    bias: Bias
    first: Floats
    meant: Floats
    dice: int

    @classmethod
    def nothing(
        cls, target: Floats, orbits: Integers, first: Floats, tables: int, dice: int
    ) -> KnownOdds:
        """Nothing yet, of so many dice at most, with measures as those of the first (f,), and of
        tables with so many measures."""
        deviations = [
            np.repeat([COMMON, by_table, by_shape, own], [1, tables, len(first), dice])
            for by_table in BY_TABLE
            for by_shape, own in BY_SHAPE
        ]
        return cls(target, orbits, Bias(np.array(deviations)), first, np.zeros(tables), dice)

    def learn(
        self, shape: Floats, number: int, table: Floats, odds: Floats, counts: Integers
    ) -> None:
        """Take note of counts (k,) of the die of a number, with measures (f,), on a table with
        measures (d,), and odds (k,) in the model."""
        pooled = np.rint(self._by_orbit(counts)).astype(np.int64)
        self.bias.learn(self._features(shape, number, table), self._by_orbit(odds), pooled)

    def logarithms(self, shape: Floats, number: int | None, table: Floats) -> Floats:
        """(..., k) of the outcomes' odds over those in the model on tables (..., d); of a die that
        was thrown, or of another for None."""
        return self.bias.logarithms(self._features(shape, number, table))[..., self.orbits]

    def variation(self, shape: Floats, number: int, table: Floats, odds: Floats) -> float:
        """Total variation from the target that is to be expected of a die that was thrown, with
        odds (k,) in the model."""
        belief = self.bias.belief(self._features(shape, number, table), self._by_orbit(odds))
        return expected_variation(belief, self._by_orbit(self.target))

    def _by_orbit(self, values: Floats | Integers) -> Floats:
        sums: Floats = np.bincount(self.orbits, values).astype(np.float64)
        return sums

    def _features(self, shape: Floats, number: int | None, table: Floats) -> Floats:
        """(..., 1 + d + f + n) what the bias depends on."""
        own = np.zeros(self.dice)
        if number is not None:
            own[number] = 1.0
        of_die = np.concatenate([shape - self.first, own])
        ones = np.ones((*table.shape[:-1], 1))
        rows = np.broadcast_to(of_die, (*table.shape[:-1], len(of_die)))
        return np.concatenate([ones, table, rows], axis=-1)
