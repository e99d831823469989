"""Which of several equally probable outcomes is on which facet.

Outcomes whose labels are numbers change places with those of the same probabilities, so that
numbers on opposite facets have the same sum, or so that sums over opposite facets and around
corners are as even as possible: by a search, and an integer program that proves its answer or
    betters it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import EQUAL_PROBABILITIES, LEVEL_ANGLE

NUMBER: Final = re.compile(r"[+-]?\d+([.]\d*)?")
"""Labels that count as numbers."""

TRIES: Final = 300
"""Random arrangements that a search begins with."""

MOST_SUMS: Final = 100_000_000
"""Sums that a search computes, about, before it takes no further beginning."""

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

CERTAIN: Final = (0, 2)
"""Statuses of `scipy.optimize.milp` that are certain: solved, and infeasible."""


def opposite_facets(hull: ConvexHull, facets: Integers) -> Integers:
    """(k,) facets of a hull that are level on top while it rests on facets (k,), or -1 where the
    nearest to that leans by more than `LEVEL_ANGLE`."""
    angles = angle_between(-hull.normals[facets][:, None], hull.normals[None])
    return np.where(angles.min(axis=1) <= LEVEL_ANGLE, angles.argmin(axis=1), -1)


def number_die(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], probabilities: Floats, style: str
) -> tuple[Integers, str]:
    """The numbering of a die in a style: (k,) outcome that is on the facet of each outcome as it
    was, and what came of it, in a sentence.

    Parameters
    ----------
    hull: of the die.
    facets: (k,) facet that it rests on in each outcome.
    labels: k texts; only those that are numbers change places.
    probabilities: (k,) wanted; only outcomes of equal probabilities, to `EQUAL_PROBABILITIES`,
        change places with each other.
    style: "standard" for numbers on opposite facets that sum to twice the mean of all, or are as
        near to that as can be; "balanced" for sums over opposite facets and around the corners of
        the hull as near as can be to the mean times the number of their facets.
    """
    order = np.arange(len(labels))
    members = np.flatnonzero([NUMBER.fullmatch(label) is not None for label in labels])
    probabilities, facets = probabilities[members], facets[members]
    by_probabilities = np.argsort(probabilities, kind="stable")
    apart = (
        np.diff(probabilities[by_probabilities], prepend=-1.0)
        > EQUAL_PROBABILITIES * probabilities[by_probabilities]
    )
    kinds = np.empty(len(members), dtype=np.int64)
    kinds[by_probabilities] = np.cumsum(apart) - 1
    if not len(members) or np.bincount(kinds).max() < 2:
        return order, "numbering: no two numbers are equally probable, so that they stay"
    is_across = opposite_facets(hull, facets)[:, None] == facets
    pairs = np.argwhere(np.triu(is_across & is_across.T, 1))
    groups = list(pairs)
    if style == "standard" and not groups:
        note = "numbering: no two facets with numbers are opposite to each other, so that they stay"
        return order, note
    if style != "standard":
        place = np.full(len(hull.normals), -1)
        place[facets] = np.arange(len(facets))
        start, half_edges = hull.outgoing
        around = [np.sort(place[each]) for each in np.split(hull.facet[half_edges], start[1:-1])]
        groups += [each[each >= 0] for each in around if (each >= 0).sum() >= 2]
    is_member = np.zeros((len(groups), len(members)))
    for row, group in zip(is_member, groups, strict=True):
        row[group] = 1.0
    numbers = np.array([float(labels[outcome]) for outcome in members.tolist()])
    task = EvenSums.of(numbers, kinds, is_member)
    best = task.best([np.arange(len(members)), _pair_opposites(numbers, kinds, pairs)])
    order[members] = members[best.order]
    sums = is_member @ numbers[best.order]
    if style == "standard":
        low, high = sums.min(), sums.max()
        sums = f"{low:g}" if high - low < 1e-9 * (1.0 + abs(low)) else f"{low:g} to {high:g}"
        note = f"numbering: numbers on opposite facets sum to {sums}"
    else:
        off = np.abs(sums - is_member.sum(axis=1) * numbers.mean()).max(initial=0.0)
        note = (
            "numbering: sums of opposite facets and around corners are even to within "
            f"{round(float(off), 6):g}"
        )
    if not best.is_best:
        note += "; that is the best that was found, but there may be better ones"
    return order, note


def _pair_opposites(numbers: Floats, kinds: Integers, pairs: Integers) -> Integers:
    """(m,) an order in which, from place to place, the smallest number that is left comes onto a
    place and the largest one that is left onto the opposite place, where that is of its kind."""
    left: dict[int, list[int]] = {kind: [] for kind in kinds.tolist()}
    for number in np.argsort(numbers, kind="stable").tolist():
        left[int(kinds[number])].append(number)
    order = np.full(len(numbers), -1)
    for place, other in pairs.tolist():
        if kinds[place] == kinds[other]:
            mine = left[int(kinds[place])]
            order[place], order[other] = mine.pop(0), mine.pop()
    for place in np.flatnonzero(order < 0).tolist():
        order[place] = left[int(kinds[place])].pop(0)
    return order


@dataclass(frozen=True, eq=False)
class Arrangement:
    """Which number is where.

    Attributes
    ----------
    order: (k,) index of the number on each place.
    largest, total: absolute deviations of its sums, in units of the least gap between numbers. An
        even sum is the mean of all numbers times the members of the group.
    is_best: whether there is none better.
    """

    order: Integers
    largest: float
    total: float
    is_best: bool

    def beats(self, other: Arrangement) -> bool:
        """Whether its largest deviation is less, or at equal ones the total."""
        if abs(self.largest - other.largest) > FINEST:
            return self.largest < other.largest
        return self.total < other.total - FINEST


@dataclass(frozen=True, eq=False)
class EvenSums:
    """Numbers to be put onto places so that their sums over groups of places are even.

    Attributes
    ----------
    values: (k,) numbers less their mean in units of the least gap: an even sum is 0.
    kinds: (k,) a number may go to the places whose own numbers are of its kind.
    groups: (g, k) 1.0 where a place belongs to a group, else 0.0.
    least: (g,) deviations that no arrangement is below.
    """

    values: Floats
    kinds: Integers
    groups: Floats
    least: Floats

    @classmethod
    def of(cls, numbers: Floats, kinds: Integers, groups: Floats) -> EvenSums:
        """The task for finite numbers (k,)."""
        gaps = np.diff(np.unique(numbers))
        values = (numbers - numbers.mean()) / (gaps.min() if len(gaps) else 1.0)
        steps, least = values - values[0], np.zeros(len(groups))
        if np.abs(steps - np.rint(steps)).max(initial=0.0) <= FINEST:
            # All numbers are whole units apart.
            offset = groups.sum(axis=1) * float(values[0])
            least = np.abs(offset - np.rint(offset))
        return cls(values, kinds, groups, least)

    @cached_property
    def _swaps(self) -> Integers:
        """(2, s) the places of all swaps."""
        pairs = np.stack(np.triu_indices(len(self.kinds), 1))
        return pairs[:, self.kinds[pairs[0]] == self.kinds[pairs[1]]]

    def arrange(self, order: Integers) -> Arrangement:
        """An order (k,) with what it is worth."""
        deviations = np.abs(self.groups @ self.values[order])
        largest, total = float(deviations.max(initial=0.0)), float(deviations.sum())
        most, sum_of_least = self.least.max(initial=0.0), float(self.least.sum())
        is_best = largest <= most + FINEST and total <= sum_of_least + FINEST
        return Arrangement(order, largest, total, bool(is_best))

    def best(self, starts: Sequence[Integers]) -> Arrangement:
        """The best arrangement, or where the limits do not allow to know it the best one found.

        starts: orders (k,) of which the first as good as any is kept; at least one.
        """
        best = self.arrange(starts[0])
        for start in starts[1:]:
            other = self.arrange(start)
            best = other if other.beats(best) else best
        if not self._swaps.size:
            return replace(best, is_best=True)
        best = best if best.is_best else self._search(best)
        if best.is_best or np.square(np.bincount(self.kinds)).sum() > MOST_CHOICES:
            return best
        answers = []
        for largest, total in ((-FINEST, math.inf), (FINEST, -FINEST)):
            better, is_certain = self._solve(best.largest + largest, best.total + total)
            answers.append(is_certain)
            best = better if better is not None and better.beats(best) else best
        return replace(best, is_best=all(answers))

    def _search(self, best: Arrangement) -> Arrangement:
        """The best of those that swaps lead to from an arrangement and from random ones."""
        generator, order = np.random.default_rng(0), best.order
        swaps = min(self._swaps.shape[1], MOST_SWAPS)
        for turn in range(min(TRIES, 1 + MOST_SUMS // (self.groups.size * swaps))):
            # By turns: squares lead farther, and then the measure itself.
            for squared in (False,) if turn % 2 else (True, False):
                order = self._descend(order, squared, generator)
            tried = self.arrange(order)
            best = tried if tried.beats(best) else best
            if best.is_best:
                break
            order = np.arange(len(self.values))
            for kind in np.unique(self.kinds):
                members = np.flatnonzero(self.kinds == kind)
                order[members] = generator.permutation(members)
        return best

    def _descend(self, order: Integers, squared: bool, generator: np.random.Generator) -> Integers:
        """The order to which the best swaps lead until none helps."""
        swaps = self._swaps
        if swaps.shape[1] > MOST_SWAPS:
            swaps = swaps[:, generator.permutation(swaps.shape[1])[:MOST_SWAPS]]
        one, other = swaps
        change = (self.groups[:, other] - self.groups[:, one]).T

        def worth(deviations: Floats) -> Floats:
            """(s,) what deviations (s, g) are worth, the less the better."""
            if squared:
                return np.square(deviations).sum(axis=1)
            size = np.abs(deviations)
            return np.asarray(WEIGHT * size.max(axis=1) + size.sum(axis=1))

        values, order = self.values[order], order.copy()
        while True:
            deviations = self.groups @ values
            after = worth(deviations + change * (values[one] - values[other])[:, None])
            best = int(after.argmin())
            if not after[best] < worth(deviations[None])[0] - FINEST:
                return order
            swap = swaps[:, best]
            order[swap], values[swap] = order[swap[::-1]], values[swap[::-1]]

    def _solve(self, largest: float, total: float) -> tuple[Arrangement | None, bool]:
        """The arrangement of least total, or where that may be any of least largest deviation,
        within these bounds, by an integer program; None where none was found. And whether that
        answer is certain.

        Its variables are a binary for each number and each place that it may go to, the deviation
        of each group, and the largest of these.
        """
        from scipy.optimize import Bounds, LinearConstraint, milp

        number, place = np.nonzero(self.kinds[:, None] == self.kinds[None])
        count, groups, choices = len(self.values), len(self.groups), len(number)
        once = np.zeros((2 * count, choices))
        once[number, np.arange(choices)] = 1.0
        once[count + place, np.arange(choices)] = 1.0
        sums = self.groups[:, place] * self.values[number]
        each, all_of_them = np.eye(groups), np.ones((groups, 1))
        rows = np.block(
            [
                [once, np.zeros((2 * count, groups + 1))],
                [sums, -each, 0.0 * all_of_them],
                [-sums, -each, 0.0 * all_of_them],
                [0.0 * sums, each, -all_of_them],
                [np.zeros((1, choices)), all_of_them.T, np.zeros((1, 1))],
            ]
        )
        parts = (choices, groups, 1)
        upper = np.repeat([1.0, 0.0, total], (2 * count, 3 * groups, 1))
        lower = np.repeat([1.0, -math.inf], (2 * count, 3 * groups + 1))
        answer = milp(
            np.repeat([0.0, 0.0, 1.0] if math.isinf(total) else [0.0, 1.0, 0.0], parts),
            constraints=LinearConstraint(rows, lower, upper),
            bounds=Bounds(0.0, np.repeat([1.0, math.inf, largest], parts)),
            integrality=np.repeat([1, 0, 0], parts),
            # Limited by nodes, not by a clock, so that the answer is the same each time.
            options={"node_limit": NODES},
        )
        if answer.x is None:
            return None, answer.status in CERTAIN
        taken = answer.x[:choices] > 0.5
        order = np.empty(count, dtype=np.int64)
        order[place[taken]] = number[taken]
        return self.arrange(order), answer.status in CERTAIN
