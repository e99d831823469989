"""Numbers among equally probable outcomes, compared with all permutations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
import pytest

from dicedesign.fabricate.numbering import number_die
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.optimize.starts.shapes import hendecahedron
from dicedesign.optimize.targets import sum_of_dice
from dicedesign.runtime.arrays import Floats, Integers
from tests.reference.solids import PLATONIC


def fair(hull: ConvexHull, style: str) -> tuple[Integers, str]:
    count = len(hull.normals)
    labels = [str(k + 1) for k in range(count)]
    return number_die(hull, np.arange(count), labels, np.full(count, 1.0 / count), style)


def place_numbers(hull: ConvexHull, style: str) -> Floats:
    """The numbers on the facets."""
    return 1.0 + fair(hull, style)[0]


def groups(hull: ConvexHull) -> Floats:
    """(g, m) opposite facets and facets around corners, by where the corners lie."""
    rows = []
    normals, extent = hull.normals, np.ptp(hull.vertices)
    for one in range(len(normals)):
        for other in range(one):
            if normals[one] @ normals[other] < -1.0 + 1e-9:
                rows.append(np.isin(np.arange(len(normals)), [one, other]))
    tops = (hull.vertices @ normals.T).max(axis=0)
    rows += [np.abs(vertex @ normals.T - tops) < 1e-9 * extent for vertex in hull.vertices]
    return np.array(rows, dtype=float)


def assert_best(sums: Floats, all_sums: Floats, member: Floats, mean: float) -> None:
    """Assert that sums (g,) deviate least among all (n, g): in the largest deviation, then in
    total."""
    off, others = (np.abs(each - member.sum(axis=1) * mean) for each in (sums, all_sums))
    largest, least = others.max(axis=1), others.max(axis=1).min()
    assert off.max() == pytest.approx(least)
    assert off.sum() == pytest.approx(others[largest < least + 1e-9].sum(axis=1).min())


@pytest.mark.parametrize(
    ("name", "total"), [("cube", 7), ("octahedron", 9), ("dodecahedron", 13), ("icosahedron", 21)]
)
def test_opposite_facets_have_one_sum(name: str, total: int) -> None:
    hull = convex_hull(PLATONIC[name])
    numbers = place_numbers(hull, "standard")
    assert sorted(numbers) == list(range(1, len(numbers) + 1))
    across = (hull.normals @ hull.normals.T).argmin(axis=1)
    np.testing.assert_array_equal(numbers + numbers[across], total)
    assert fair(hull, "standard")[1].endswith(f"sum to {total}")


@pytest.mark.parametrize("name", ["octahedron", "dodecahedron"])
def test_usual_numbers_are_the_best_with_one_sum_across(name: str) -> None:
    """Compared with all ways to put pairs onto opposite facets, the first up to a turn."""
    hull = convex_hull(PLATONIC[name])
    count = len(hull.normals)
    across = (hull.normals @ hull.normals.T).argmin(axis=1)
    near = np.flatnonzero(across > np.arange(count))
    everything = np.empty((math.factorial(count // 2) << (count // 2), count))
    ways = product(permutations(range(1, count // 2 + 1)), product((0, 1), repeat=count // 2))
    for row, (low, turned) in zip(everything, ways, strict=True):
        numbers = np.where(turned, count + 1 - np.array(low), low)
        row[near], row[across[near]] = numbers, count + 1 - numbers
    member, numbers = groups(hull), place_numbers(hull, "auto")
    np.testing.assert_array_equal(numbers + numbers[across], count + 1)
    assert_best(member @ numbers, everything @ member.T, member, count / 2.0 + 0.5)


def test_equal_numbers_are_apart() -> None:
    """1 to 6 twice on a dodecahedron: opposite sums are 7, and no corner has a number twice."""
    hull = convex_hull(PLATONIC["dodecahedron"])
    labels = [str(k + 1) for k in range(6)] * 2
    order, _ = number_die(hull, np.arange(12), labels, np.full(12, 1.0 / 12.0), "auto")
    numbers = 1.0 + order % 6
    across = (hull.normals @ hull.normals.T).argmin(axis=1)
    np.testing.assert_array_equal(numbers + numbers[across], 7.0)
    for member in groups(hull)[6:].astype(bool):
        assert len(set(numbers[member])) == 3


@pytest.mark.parametrize("name", ["tetrahedron", "octahedron"])
def test_balanced_numbers_are_the_best_of_all_permutations(name: str) -> None:
    hull = convex_hull(PLATONIC[name])
    member, count = groups(hull), len(hull.normals)
    everything = np.array(list(permutations(np.arange(1.0, count + 1.0))))
    assert_best(
        member @ place_numbers(hull, "balanced"), everything @ member.T, member, count / 2.0 + 0.5
    )


def swaps_of_two_dice() -> Iterator[tuple[int, ...]]:
    """The orders of 2 to 12 in which only equally probable totals change places."""
    for turned in product((False, True), repeat=5):
        order = list(range(11))
        for k, turn in enumerate(turned):
            if turn:
                order[k], order[10 - k] = 10 - k, k
        yield tuple(order)


def test_only_equally_probable_outcomes_change_places() -> None:
    start = hendecahedron("bisymmetric")
    hull = convex_hull(start.points)
    facets = (start.directions @ hull.normals.T).argmax(axis=1)
    target = sum_of_dice([6, 6])
    member = groups(hull)[:, facets]
    member = member[member.sum(axis=1) >= 2]
    orders = np.array(list(swaps_of_two_dice()))
    order, _ = number_die(hull, facets, target.labels, target.probabilities, "balanced")
    np.testing.assert_allclose(target.probabilities[order], target.probabilities, rtol=1e-12)
    assert_best(member @ (2.0 + order), (2.0 + orders) @ member.T, member, 7.0)


def test_labels_without_numbers_stay() -> None:
    hull = convex_hull(PLATONIC["cube"])
    labels = ["10", "star", "-2", "0.5", "1", "6.5"]
    order, _ = number_die(hull, np.arange(6), labels, np.full(6, 1.0 / 6.0), "standard")
    assert order[1] == 1
    assert sorted(order) == list(range(6))
