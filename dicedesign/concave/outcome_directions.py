"""Directions of a surface that may become the outcomes, the cheapest to bring about first.

A body tips from each direction that it is set down with to the outcome that it is to end in, and on
the way it must not have to climb: what it climbs now is what its hull has to give way. So a choice
of k directions costs what the cheapest assignment of all directions to them costs, in which each
gets its share q of the sphere, by the climb on the great arc to it.
"""

from __future__ import annotations

import math
from itertools import combinations, permutations

import numpy as np

from dicedesign.concave.slopes import great_arcs, largest_rise
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import even_directions
from dicedesign.rest.poses import analyze
from dicedesign.runtime.arrays import Floats, Integers

SPREAD = 60
"""Candidates that are spread over the sphere, or a few for each outcome, beside the rests."""

SPREAD_EACH = 8
"""Of them for each outcome, at least."""

DISTINCT = math.radians(10.0)
"""Angle between candidates, at least; half of that between the spread ones where those are many."""

SAMPLES = 300
"""Directions that the body is set down with."""

HEIGHTS = (120, 240)
"""Heights of the body that are kept, by latitude and longitude: every degree and a half."""

ARC = 24
"""Places on each great arc."""

SOFTNESS = 0.01
"""Climb, over the circumscribed radius, by which an assignment may be dearer than the cheapest."""

BALANCINGS = 30
"""Times that the shares are balanced in turn."""

MOST_SETS = 100_000
"""Sets of candidates that are looked at; where there are more, so many at random, and fewer for
more than `FEW` outcomes."""

FEW = 4
"""Number of outcomes for which that many sets fit into memory at a time."""

MOST_ASSIGNED = 3_000
"""Of them, whose assignments are computed: those that would cost least with any shares."""

MOST_ORDERED = 200
"""Of those, whose candidates are assigned to the outcomes in every order."""

MOST_ORDERS = 24
"""Orders that are tried; with more outcomes, the one by natural shares alone."""

IMPROVED = 2
"""Times that one candidate is exchanged in each of the best of sets drawn at random."""

LOOSENED = 0.85
"""Factor of the wanted angle where no set of candidates is as far apart."""

MOST_CHOICES = 60
"""Choices that are given."""

DIFFERENT = math.cos(math.radians(18.0))
"""Cosine, at most, between the directions of two choices in the outcome where they differ most."""


def outcome_choices(hull: ConvexHull, target: Floats, apart: float, seed: int) -> list[Floats]:
    """Choices of (k, 3) unit directions for the outcomes of a target (k,), the cheapest first.

    Parameters
    ----------
    hull: about the center of mass at the origin, of circumscribed radius about 1.
    target: (k,) the probabilities.
    apart: least angle between two directions of a choice, in radians, where there are any so far
        apart.
    seed: of the candidates that are spread over the sphere, and of sets where there are too many.

    Raises
    ------
    InputError: a hull of that many corners has fewer facets than there are outcomes.
    """
    count = len(target)
    most = 2 * len(hull.vertices) - 4
    if count > most:
        raise InputError(
            f"target: expected at most {most} outcomes for a hull of {len(hull.vertices)} corners, "
            f"got {count}; join some, or refine the surface with method.concave.points"
        )
    random = np.random.default_rng([seed, count])
    candidates = _candidates(hull, count, random)
    costs = _climbs(hull.vertices, _spread(SAMPLES, random), candidates)
    # The most probable outcome first: the candidates of a set are ordered by their natural shares.
    order = np.argsort(-target, kind="stable")
    shares = target[order]
    sets = _sets(costs, candidates, count, apart, shares, random)
    price, sets = _order_sets(costs, sets, shares)
    is_equal = target[:, None] == target
    chosen: list[Floats] = []
    for place in np.argsort(price, kind="stable"):
        directions = np.empty((count, 3))
        directions[order] = candidates[sets[place]]
        # Outcomes of equal probability count as the same.
        cosines = [np.where(is_equal, directions @ other.T, -1.0) for other in chosen]
        if all(
            min(cosine.max(axis=1).min(), cosine.max(axis=0).min()) < DIFFERENT
            for cosine in cosines
        ):
            chosen.append(directions)
        if len(chosen) == MOST_CHOICES:
            break
    return chosen


def _candidates(hull: ConvexHull, count: int, random: np.random.Generator) -> Floats:
    """(m, 3) the rests, the most probable first, and directions between them."""
    rests = analyze(hull, np.zeros(3), "given").normals
    spread = _spread(max(SPREAD, SPREAD_EACH * count), random)
    least = min(DISTINCT, 0.5 * math.sqrt(4.0 * math.pi / len(spread)))
    chosen = np.zeros((0, 3))
    for direction in (*rests, *spread):
        if (chosen @ direction).max(initial=-1.0) <= math.cos(least):
            chosen = np.vstack([chosen, direction])
    return chosen


def _spread(count: int, random: np.random.Generator) -> Floats:
    """(count, 3) directions all over the sphere, turned at random."""
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return np.asarray(even_directions(count) @ axes)


def _climbs(vertices: Floats, starts: Floats, ends: Floats) -> Floats:
    """(s, e) as `slopes.climbs`, from heights that are looked up in a table."""
    rows, columns = HEIGHTS
    latitude = (np.arange(rows) + 0.5) * math.pi / rows
    longitude = (np.arange(columns) + 0.5) * 2.0 * math.pi / columns - math.pi
    table = np.empty(HEIGHTS)
    for row, angle in enumerate(latitude.tolist()):
        circle = math.sin(angle) * np.stack([np.cos(longitude), np.sin(longitude)])
        ring = np.stack([*circle, np.full(columns, math.cos(angle))], axis=1)
        table[row] = (ring @ vertices.T).max(axis=1)
    x, y, z = np.moveaxis(great_arcs(starts, ends, math.inf, ARC), -1, 0)
    row = np.minimum(np.arccos(np.clip(z, -1.0, 1.0)) / math.pi * rows, rows - 1)
    turn = np.minimum((np.arctan2(y, x) + math.pi) / (2.0 * math.pi) * columns, columns - 1)
    return largest_rise(table[row.astype(np.int64), turn.astype(np.int64)])


def _sets(
    costs: Floats,
    candidates: Floats,
    count: int,
    apart: float,
    shares: Floats,
    random: np.random.Generator,
) -> Integers:
    """(m, k) sets of candidates that are apart, the cheapest by natural shares."""
    cosines = candidates @ candidates.T
    while True:
        near = cosines > math.cos(apart) + 1e-12
        np.fill_diagonal(near, True)
        every = math.comb(len(candidates), count) <= MOST_SETS and count <= FEW
        if every:
            sets = np.array(list(combinations(range(len(near)), count)), dtype=np.int64)
            for one, other in combinations(range(count), 2):
                sets = sets[~near[sets[:, one], sets[:, other]]]
        else:
            sets = _draw_sets(near, count, random)
        if len(sets) > 0:
            break
        apart *= LOOSENED
    sets = _cheapest(costs, sets, MOST_ASSIGNED)
    for _ in range(0 if every else IMPROVED):
        prices = _assign_samples(costs, _by_natural_share(costs, sets), shares)
        best = sets[np.argsort(prices, kind="stable")[:MOST_ORDERED]]
        exchanged = _exchange(near, best)
        sets = np.unique(np.concatenate([best, _cheapest(costs, exchanged, MOST_ASSIGNED)]), axis=0)
    return sets


def _at_a_time(most: int, count: int) -> int:
    """Number of sets to compute at a time, of `most` for few outcomes: what is
    computed grows with the square of their number, as there are more candidates too."""
    return max(1, round(most * min(1.0, (FEW / count) ** 2)))


def _draw_sets(near: np.ndarray, count: int, random: np.random.Generator) -> Integers:
    """Sets that are drawn one candidate after the other, all at once."""
    drawn = _at_a_time(MOST_SETS, count)
    free = np.ones((drawn, len(near)), dtype=bool)
    sets = np.empty((drawn, count), dtype=np.int64)
    for place in range(count):
        sets[:, place] = np.where(free, random.random(free.shape), -1.0).argmax(axis=1)
        # Where none was left, the first is taken again, and the set is dropped.
        lost = ~free[np.arange(len(sets)), sets[:, place]]
        free &= ~near[sets[:, place]]
        free, sets = free[~lost], sets[~lost]
    return np.unique(np.sort(sets, axis=1), axis=0)


def _exchange(near: np.ndarray, sets: Integers) -> Integers:
    """The sets (m, k) with one candidate exchanged for any other that is apart from the rest."""
    sums = []
    for place in range(sets.shape[1]):
        others = np.delete(sets, place, axis=1)
        number, candidate = np.nonzero(~near[others].any(axis=1))
        sums.append(np.column_stack([others[number], candidate]))
    return np.unique(np.sort(np.concatenate(sums), axis=1), axis=0)


def _cheapest(costs: Floats, sets: Integers, most: int) -> Integers:
    """The sets that cost least if every direction may go to the nearest of them."""
    bound = np.empty(len(sets))
    step = _at_a_time(MOST_ASSIGNED, sets.shape[1])
    for first in range(0, len(sets), step):
        part = slice(first, first + step)
        bound[part] = costs[:, sets[part]].min(axis=2).mean(axis=0)
    return sets[np.argsort(bound, kind="stable")[:most]]


def _by_natural_share(costs: Floats, sets: Integers) -> Integers:
    """The sets, each in the order of what goes to its candidates by itself, the most first."""
    nearest = costs[:, sets].argmin(axis=2)
    natural = np.stack([(nearest == place).sum(axis=0) for place in range(sets.shape[1])], axis=1)
    return np.take_along_axis(sets, np.argsort(-natural, axis=1, kind="stable"), axis=1)


def _order_sets(costs: Floats, sets: Integers, shares: Floats) -> tuple[Floats, Integers]:
    """Costs (m,) of sets (m, k) in the orders that cost least."""
    sets = _by_natural_share(costs, sets)
    prices = _assign_samples(costs, sets, shares)
    if len(np.unique(shares)) == 1 or math.factorial(len(shares)) > MOST_ORDERS:
        return prices, sets
    best = sets[np.argsort(prices, kind="stable")[:MOST_ORDERED]]
    tried = np.concatenate([best[:, list(order)] for order in permutations(range(len(shares)))])
    return _assign_samples(costs, tried, shares), tried


def _assign_samples(costs: Floats, sets: Integers, shares: Floats) -> Floats:
    """(m,) cost of the cheapest assignment of the samples to sets (m, k) with their shares (k,).

    Source: Cuturi, Sinkhorn distances (NeurIPS 2013).
    """
    prices = np.empty(len(sets))
    step = _at_a_time(MOST_ASSIGNED, sets.shape[1])
    for first in range(0, len(sets), step):
        part = sets[first : first + step]
        climb = costs[:, part]
        kernel = np.exp(-climb / SOFTNESS) + 1e-300
        weights = np.ones(part.shape)
        for _ in range(BALANCINGS):
            rows = 1.0 / (len(costs) * np.einsum("smk,mk->sm", kernel, weights))
            weights = shares / np.einsum("smk,sm->mk", kernel, rows)
        flow = kernel * rows[:, :, None] * weights
        prices[first : first + step] = (flow * climb).sum(axis=(0, 2))
    return prices
