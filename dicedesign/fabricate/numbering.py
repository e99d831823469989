"""Assign equally probable outcomes to facets so that sums of numbers are even.

Equally probable outcomes whose labels are numbers change places. Then all pairs of opposite facets
have one sum, or sums over opposite facets and around corners are as even as a search finds. It
swaps labels from the given order and from random ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import EQUAL_PROBABILITIES, LEVEL_ANGLE

NUMBER = re.compile(r"[+-]?\d+([.]\d*)?")
"""Labels that count as numbers."""

TRIES = 300
"""Largest number of orders that the search starts from."""

MOST_SUMS = 100_000_000
"""Approximate number of sums after which the search takes no further start."""

MOST_SWAPS = 2000
"""Largest number of swaps compared in one step."""

FINEST = 1e-3
"""Largest difference between equal deviations, over the least gap between numbers; deviations of
whole numbers on k places differ by 1 / k or more."""

PAIR_WEIGHT = 100.0
"""Weight of deviations across opposite facets beside those around corners, if the former come
first."""

WEIGHT = 1e8
"""Weight of the largest deviation beside the sum of all: more than any sum over `FINEST`."""


def opposite_facets(hull: ConvexHull, facets: Integers) -> Integers:
    """(k,) facets of a hull that are level on top while it rests on facets (k,), or -1 where the
    nearest to that leans by more than `LEVEL_ANGLE`."""
    angles = angle_between(-hull.normals[facets][:, None], hull.normals[None])
    return np.where(angles.min(axis=1) <= LEVEL_ANGLE, angles.argmin(axis=1), -1)


def number_die(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], probabilities: Floats, style: str
) -> tuple[Integers, str]:
    """Number a die: (k,) outcome that moves to the facet of each outcome, and a sentence about the
    sums.

    Parameters
    ----------
    hull: of the die.
    facets: (k,) facet that it rests on in each outcome.
    labels: k texts; only numbers change places.
    probabilities: (k,) wanted; only outcomes of equal probabilities, to `EQUAL_PROBABILITIES`,
        change places with each other.
    style: "standard" for numbers on opposite facets that sum to twice the mean of all, or nearly;
        "balanced" for sums over opposite facets and around the corners of the hull near the mean
        times the number of their facets; "auto" for the former first, then for the latter.
    """
    order = np.arange(len(labels))
    members = np.flatnonzero([NUMBER.fullmatch(label) is not None for label in labels])
    probabilities, facets = probabilities[members], facets[members]
    kinds = _kinds(probabilities)
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
    is_auto = style == "auto"
    weights = np.where(np.arange(len(groups)) < len(pairs) * is_auto, PAIR_WEIGHT, 1.0)
    best = _even_out(
        numbers,
        kinds,
        weights[:, None] * is_member,
        _pair_opposites(numbers, kinds, pairs),
        pairs if is_auto else pairs[:0],
    )
    order[members] = members[best]
    sums, notes = is_member @ numbers[best], []
    off = np.abs(sums - is_member.sum(axis=1) * numbers.mean())
    across = sums[: len(pairs)]
    if style != "balanced" and len(pairs):
        low, high = across.min(), across.max()
        total = f"{low:g}" if high - low < 1e-9 * (1.0 + abs(low)) else f"{low:g} to {high:g}"
        notes.append(f"numbers on opposite facets sum to {total}")
    if style != "standard":
        what = "around corners" if is_auto else "of opposite facets and around corners"
        most = off[len(pairs) * is_auto :].max(initial=0.0)
        notes.append(f"sums {what} are even to within {round(float(most), 6):g}")
    return order, f"numbering: {'; '.join(notes)}"


def spread_labels(normals: Floats, labels: Sequence[str], probabilities: Floats) -> Integers:
    """(f,) face whose label moves to each face: those with the same label come around the die, as
    far as swaps of equally probable faces get. So their engravings balance each other.

    normals: (f, 3) of the faces; labels: f texts; probabilities: (f,).
    """
    kinds, order = _kinds(probabilities), np.arange(len(labels))
    _, label = np.unique(labels, return_inverse=True)
    first, second = np.triu_indices(len(labels), 1)
    free = (kinds[first] == kinds[second]) & (label[first] != label[second])
    first, second = first[free], second[free]
    while len(first) > 0:
        own = label[order]
        sums = np.zeros((label.max() + 1, 3))
        np.add.at(sums, own, normals)
        # Changes of the summed squares of these by each swap.
        step = normals[second] - normals[first]
        apart = (step * (sums[own[first]] - sums[own[second]])).sum(-1)
        change = np.where(own[first] == own[second], 0.0, 2.0 * (apart + (step * step).sum(-1)))
        best = int(change.argmin())
        if not change[best] < -FINEST:
            break
        order[[first[best], second[best]]] = order[[second[best], first[best]]]
    return order


def _kinds(probabilities: Floats) -> Integers:
    """(m,) number of the class of equal probabilities (m,), the least first."""
    ascending = np.argsort(probabilities, kind="stable")
    gaps = np.diff(probabilities[ascending], prepend=-1.0)
    kinds = np.empty(len(probabilities), dtype=np.int64)
    kinds[ascending] = np.cumsum(gaps > EQUAL_PROBABILITIES * probabilities[ascending]) - 1
    return kinds


def _pair_opposites(numbers: Floats, kinds: Integers, pairs: Integers) -> Integers:
    """(m,) order that puts the smallest and the largest remaining number of a kind onto each pair
    of opposite places in turn."""
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


def _even_out(
    numbers: Floats, kinds: Integers, groups: Floats, paired: Integers, pairs: Integers
) -> Integers:
    """Search for the order (m,) of numbers whose sums over groups deviate least from the mean of
    all numbers times the members of the group: in the largest deviation, then in their sum.

    numbers: (m,) finite; kinds: (m,) a number may move to places whose own numbers are of its kind;
    groups: (g, m) the group's weight where a place belongs to it, else 0.0; paired: (m,) an order
    to start from beside the given one; pairs: (p, 2) places whose numbers may also change places
    with those of another pair at once.
    """
    gaps = np.diff(np.unique(numbers))
    values = (numbers - numbers.mean()) / (gaps.min() if len(gaps) else 1.0)
    one, other = np.triu_indices(len(kinds), 1)
    near = np.argwhere(np.triu(groups.T @ (groups == 1.0), 1) > 0.0).T
    swaps = [[swap] for swap in zip(one, other, strict=True)]
    for (a, b), (c, d) in combinations(pairs.tolist(), 2):
        swaps += [[(a, c), (b, d)], [(a, d), (b, c)]]
    moves = np.tile(np.arange(len(kinds)), (len(swaps), 1))
    for move, pairs_of_places in zip(moves, swaps, strict=True):
        for swap in pairs_of_places:
            move[[*swap]] = swap[::-1]
    moves = moves[(kinds[moves] == kinds).all(axis=1)]
    generator = np.random.default_rng(0)

    def cost(orders: Integers, squared: bool = False) -> Floats:
        """(...) cost of orders (..., m), the smaller the better: the largest deviation, then their
        sum; or the sum of squares. Equal numbers in a group are as bad as a step of the numbers."""
        moved = values[orders]
        deviations = np.abs(moved @ groups.T)
        equal = (moved[..., near[0]] == moved[..., near[1]]).sum(axis=-1)
        if squared:
            return np.asarray(np.square(deviations).sum(axis=-1) + equal)
        largest = deviations.max(axis=-1, initial=0.0)
        return np.asarray(WEIGHT * (largest + equal) + deviations.sum(axis=-1))

    def descend(order: Integers, squared: bool) -> Integers:
        """Order to which the best moves lead until none improves it."""
        chosen = moves
        if len(moves) > MOST_SWAPS:
            chosen = moves[generator.permutation(len(moves))[:MOST_SWAPS]]
        while True:
            costs = cost(order[chosen], squared)
            best = int(costs.argmin())
            if not costs[best] < cost(order, squared) - FINEST:
                return order
            order = order[chosen[best]]

    def candidates() -> Iterator[Integers]:
        """Orders in the order of the search."""
        yield paired
        order = best
        for turn in range(min(TRIES, 1 + MOST_SUMS // (groups.size * len(moves[:MOST_SWAPS])))):
            # Every other search minimizes squares first, which leads farther.
            if turn % 2 == 0:
                order = descend(order, True)
            yield descend(order, False)
            order = np.arange(len(kinds))
            for kind in np.unique(kinds):
                own = np.flatnonzero(kinds == kind)
                order[own] = generator.permutation(own)

    best = np.arange(len(kinds))
    for order in candidates():
        if cost(order) < cost(best) - FINEST:
            best = order
        if cost(best) <= FINEST:
            break
    return best
