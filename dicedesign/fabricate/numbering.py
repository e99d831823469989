"""Which of several equally probable outcomes is on which facet.

Outcomes whose labels are numbers change places with those of the same odds, so that numbers on
opposite facets have the same sum, or so that sums over opposite facets and around corners are as
even as possible.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from dicedesign.fabricate.even_sums import EvenSums
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import EQUAL_ODDS, LEVEL_ANGLE

NUMBER: Final = re.compile(r"[+-]?\d+([.]\d*)?")
"""Labels that count as numbers."""


def opposite_facets(hull: ConvexHull, facets: Integers) -> Integers:
    """(k,) facets of a hull that are level on top while it rests on facets (k,), or -1 where the
    nearest to that leans by more than `LEVEL_ANGLE`."""
    angles = angle_between(-hull.normals[facets][:, None], hull.normals[None])
    nearest = angles.argmin(axis=1)
    level = angles[np.arange(len(facets)), nearest] <= LEVEL_ANGLE
    return np.where(level, nearest, -1)


def numbered(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], odds: Floats, style: str
) -> tuple[Integers, str]:
    """The numbering of a die in a style: (k,) outcome that is on the facet of each outcome as it
    was, and what came of it, in a sentence.

    Parameters
    ----------
    hull: of the die.
    facets: (k,) facet that it rests on in each outcome.
    labels: k texts; only those that are numbers change places.
    odds: (k,) wanted; only outcomes of equal odds, to `EQUAL_ODDS`, change places with each other.
    style: "standard" for numbers on opposite facets that sum to twice the mean of all, or are as
        near to that as can be; "balanced" for sums over opposite facets and around the corners of
        the hull as near as can be to the mean times the number of their facets.
    """
    order = np.arange(len(labels))
    members = np.flatnonzero([NUMBER.fullmatch(label) is not None for label in labels])
    kinds = _equal(odds[members])
    if not len(members) or np.bincount(kinds).max() < 2:
        return order, "numbering: no two numbers are equally probable, so that they stay"
    pairs = _opposite_places(hull, facets[members])
    if style == "standard" and not pairs:
        note = "numbering: no two facets with numbers are opposite to each other, so that they stay"
        return order, note
    groups = pairs if style == "standard" else [*pairs, *_places_around(hull, facets[members])]
    member = np.zeros((len(groups), len(members)))
    for row, group in zip(member, groups, strict=True):
        row[group] = 1.0
    numbers = np.array([float(labels[outcome]) for outcome in members.tolist()])
    found = EvenSums(numbers, kinds, member).best(
        [np.arange(len(members)), _paired(numbers, kinds, pairs)]
    )
    order[members] = members[found.order]
    sums = member @ numbers[found.order]
    off = np.abs(sums - member.sum(axis=1) * numbers.mean()).max(initial=0.0)
    if style == "standard":
        low, high = sums.min(), sums.max()
        told = f"{low:g}" if high - low < 1e-9 * (1.0 + abs(low)) else f"{low:g} to {high:g}"
        note = f"numbering: numbers on opposite facets sum to {told}"
    else:
        note = (
            "numbering: sums of opposite facets and around corners are even to within "
            f"{round(float(off), 6):g}"
        )
    if not found.is_best:
        note += "; that is the best that was found, but there may be better ones"
    return order, note


def _equal(odds: Floats) -> Integers:
    """(m,) number of the set of equal odds that each of some odds (m,) belongs to."""
    by_odds = np.argsort(odds, kind="stable")
    apart = np.diff(odds[by_odds]) > EQUAL_ODDS * odds[by_odds][1:]
    kinds = np.zeros(len(odds), dtype=np.int64)
    kinds[by_odds] = np.concatenate([[0], np.cumsum(apart)])[: len(odds)]
    return kinds


def _opposite_places(hull: ConvexHull, facets: Integers) -> list[Integers]:
    """Pairs (2,) of places, whose facets (m,) are opposite to each other."""
    across = opposite_facets(hull, facets)
    return [
        np.array([place, other])
        for place, other in zip(*np.nonzero(across[:, None] == facets[None]), strict=True)
        if place < other and across[other] == facets[place]
    ]


def _places_around(hull: ConvexHull, facets: Integers) -> Iterator[Integers]:
    """Places (n,), n at least 2, whose facets (m,) meet at a corner, for each corner."""
    place = np.full(len(hull.normals), -1)
    place[facets] = np.arange(len(facets))
    start, half_edges = hull.outgoing
    for first, last in zip(start[:-1].tolist(), start[1:].tolist(), strict=True):
        around = place[hull.facet[half_edges[first:last]]]
        around = np.sort(around[around >= 0])
        if len(around) >= 2:
            yield around


def _paired(numbers: Floats, kinds: Integers, pairs: Sequence[Integers]) -> Integers:
    """(m,) an order in which, from place to place, the smallest number that is left comes onto a
    place and the largest one that is left onto the opposite place, where that is of its kind."""
    left = {
        int(kind): sorted(np.flatnonzero(kinds == kind).tolist(), key=lambda i: (numbers[i], i))
        for kind in np.unique(kinds)
    }
    order = np.full(len(numbers), -1)
    opposite = {a: b for pair in pairs for a, b in (pair.tolist(), pair[::-1].tolist())}
    alone = []
    for place, kind in enumerate(kinds.tolist()):
        other = opposite.get(place)
        if other is None or kinds[other] != kind:
            alone.append(place)
        elif order[place] < 0:
            order[place], order[other] = left[kind].pop(0), left[kind].pop()
    for place in alone:
        order[place] = left[int(kinds[place])].pop(0)
    return order
