"""Numbers put onto places so that their sums over groups of places are as even as possible: a
search, and an integer program that proves its answer or betters it.

Even is a sum that is the mean of all numbers times the members of the group. Of two arrangements
that one is better whose largest deviation is less, or at equal ones the total.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers

TRIES: Final = 300
"""Random arrangements that a search begins with."""

MOST_SUMS: Final = 100_000_000
"""Sums that a search computes before it takes no further beginning."""

MOST_SWAPS: Final = 2000
"""Swaps that are looked at in one step."""

MOST_CHOICES: Final = 600
"""Numbers times places among which they choose up to which an integer program is solved."""

NODES: Final = 200
"""Of the tree of an integer program that are looked at."""

FINEST: Final = 1e-3
"""Deviations that differ by no more than this, over the least gap between numbers, are equal; those
of whole numbers on k places differ by 1 / k or more."""

WEIGHT: Final = 1e8
"""Of the largest deviation beside the total: more than any total over the least difference."""

SOLVED: Final = 0

INFEASIBLE: Final = 2
"""Statuses of `scipy.optimize.milp` that are certain."""


@dataclass(frozen=True, eq=False)
class Arrangement:
    """Which number is where.

    Attributes
    ----------
    order: (k,) index of the number on each place.
    largest, total: absolute deviations of its sums, in units of the least gap between numbers.
    is_best: whether there is none better.
    """

    order: Integers
    largest: float
    total: float
    is_best: bool = False

    def beats(self, other: Arrangement) -> bool:
        """Whether it is better."""
        if abs(self.largest - other.largest) > FINEST:
            return self.largest < other.largest
        return self.total < other.total - FINEST


@dataclass(frozen=True, eq=False)
class EvenSums:
    """The task.

    Attributes
    ----------
    numbers: (k,) finite.
    kinds: (k,) a number may go to the places whose own numbers are of its kind.
    groups: (g, k) 1.0 where a place belongs to a group, else 0.0.
    """

    numbers: Floats
    kinds: Integers
    groups: Floats

    @cached_property
    def _values(self) -> Floats:
        """(k,) numbers less their mean in units of the least gap: an even sum is 0."""
        gaps = np.diff(np.unique(self.numbers))
        return (self.numbers - self.numbers.mean()) / (gaps.min() if len(gaps) else 1.0)

    @cached_property
    def _swaps(self) -> tuple[Integers, Integers]:
        """(s,) and (s,) the places of all swaps."""
        one, other = np.triu_indices(len(self.kinds), 1)
        alike = self.kinds[one] == self.kinds[other]
        return one[alike], other[alike]

    @cached_property
    def _least(self) -> Floats:
        """(g,) deviations that no arrangement is below, where all numbers are whole units apart."""
        values = self._values - self._values[0]
        if np.abs(values - np.rint(values)).max(initial=0.0) > FINEST:
            return np.zeros(len(self.groups))
        offset = self.groups.sum(axis=1) * float(self._values[0])
        return np.abs(offset - np.rint(offset))

    def arranged(self, order: Integers) -> Arrangement:
        """An order (k,) with what it is worth."""
        deviations = np.abs(self.groups @ self._values[order])
        largest, total = float(deviations.max(initial=0.0)), float(deviations.sum())
        least = self._least
        is_best = (
            largest <= least.max(initial=0.0) + FINEST and total <= float(least.sum()) + FINEST
        )
        return Arrangement(order, largest, total, is_best)

    def best(self, starts: Iterable[Integers]) -> Arrangement:
        """The best arrangement, or where the limits do not allow to know it the best one found.

        starts: orders (k,) of which the first as good as any is kept; at least one.
        """
        first, *others = (self.arranged(order) for order in starts)
        found = first
        for other in others:
            found = other if other.beats(found) else found
        if not len(self._swaps[0]):
            return replace(found, is_best=True)
        if not found.is_best:
            found = self._searched(found)
        return found if found.is_best else self._proved(found)

    def _searched(self, found: Arrangement) -> Arrangement:
        """The best of those that swaps lead to from an arrangement and from random ones."""
        generator = np.random.default_rng(0)
        order, computed = found.order, 0
        for turn in range(TRIES):
            # By turns: squares lead farther, and then the measure itself.
            for squared in (False,) if turn % 2 else (True, False):
                order, more = self._descended(order, squared, generator)
                computed += more
            tried = self.arranged(order)
            found = tried if tried.beats(found) else found
            if found.is_best or computed > MOST_SUMS:
                break
            order = np.arange(len(self.numbers))
            for kind in np.unique(self.kinds):
                members = np.flatnonzero(self.kinds == kind)
                order[members] = generator.permutation(members)
        return found

    def _descended(
        self, order: Integers, squared: bool, generator: np.random.Generator
    ) -> tuple[Integers, int]:
        """The order to which the best swaps lead until none helps, and how many sums that took."""
        one, other = self._swaps
        if len(one) > MOST_SWAPS:
            chosen = generator.permutation(len(one))[:MOST_SWAPS]
            one, other = one[chosen], other[chosen]
        change = (self.groups[:, other] - self.groups[:, one]).T
        values = self._values[order]
        order, computed = order.copy(), 0
        while True:
            deviations = self.groups @ values
            after = deviations + change * (values[one] - values[other])[:, None]
            computed += after.size
            worth = _worth(after, squared)
            best = int(worth.argmin())
            if not worth[best] < _worth(deviations[None], squared)[0] - FINEST:
                return order, computed
            swap = [one[best], other[best]]
            order[swap], values[swap] = order[swap[::-1]], values[swap[::-1]]

    def _proved(self, found: Arrangement) -> Arrangement:
        """A better arrangement by an integer program, or the same if there is none; with whether
        that is certain."""
        choices = int(np.square(np.bincount(self.kinds)).sum())
        if choices > MOST_CHOICES:
            return found
        certain = []
        for largest, total in ((-FINEST, math.inf), (FINEST, -FINEST)):
            better, is_certain = self._solved(found.largest + largest, found.total + total)
            certain.append(is_certain)
            if better is not None and better.beats(found):
                found = better
        return replace(found, is_best=all(certain))

    def _solved(self, largest: float, total: float) -> tuple[Arrangement | None, bool]:
        """The arrangement of least total, or where that may be any of least largest deviation,
        within these bounds, by an integer program; None where none was found. And whether that
        answer is certain.

        Its variables are a binary for each number and each place that it may go to, the deviation
        of each group, and the largest of these.
        """
        from scipy.optimize import Bounds, LinearConstraint, milp

        number, place = np.nonzero(self.kinds[:, None] == self.kinds[None])
        count, groups, binaries = len(self.numbers), len(self.groups), len(number)
        once = np.zeros((2 * count, binaries + groups + 1))
        once[number, np.arange(binaries)] = 1.0
        once[count + place, np.arange(binaries)] = 1.0
        sums = self.groups[:, place] * self._values[number]
        beyond = np.hstack([-np.eye(groups), np.zeros((groups, 1))])
        widest = np.hstack([np.zeros((groups, binaries)), np.eye(groups), -np.ones((groups, 1))])
        constraints = [
            LinearConstraint(once, 1.0, 1.0),
            LinearConstraint(np.hstack([sums, beyond]), -np.inf, 0.0),
            LinearConstraint(np.hstack([-sums, beyond]), -np.inf, 0.0),
            LinearConstraint(widest, -np.inf, 0.0),
        ]
        totalled = np.concatenate([np.zeros(binaries), np.ones(groups), [0.0]])
        objective = np.zeros(binaries + groups + 1)
        objective[-1] = 1.0
        if math.isfinite(total):
            objective = totalled
            constraints.append(LinearConstraint(totalled, -np.inf, total))
        answer = milp(
            objective,
            constraints=constraints,
            bounds=Bounds(0.0, np.append(np.where(totalled[:-1] > 0.0, np.inf, 1.0), largest)),
            integrality=np.where(np.arange(len(objective)) < binaries, 1, 0),
            # Limited by nodes, not by a clock, so that the answer is the same each time.
            options={"node_limit": NODES},
        )
        is_certain = answer.status in (SOLVED, INFEASIBLE)
        if answer.x is None:
            return None, is_certain
        taken = answer.x[:binaries] > 0.5
        order = np.zeros(count, dtype=np.int64)
        order[place[taken]] = number[taken]
        return self.arranged(order), is_certain


def _worth(deviations: Floats, squared: bool) -> Floats:
    """(s,) what deviations (s, g) are worth, the less the better."""
    if squared:
        return np.square(deviations).sum(axis=1)
    size = np.abs(deviations)
    return np.asarray(WEIGHT * size.max(axis=1) + size.sum(axis=1))
