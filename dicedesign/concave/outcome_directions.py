"""Choices of down directions of a surface for the outcomes, the cheapest first.

The body must tip from every direction at which it is set down to one of the outcomes without
climbing, so the hull must remove every climb. A choice of k directions costs as much as the
cheapest assignment of all directions to them that gives each its share q of the sphere, where the
cost is the climb along the great arcs.
"""

from __future__ import annotations

import math
from itertools import combinations, permutations

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, even_directions, norms, unit_vectors
from dicedesign.rest.poses import analyze
from dicedesign.runtime.arrays import Floats, Integers

MIN_SPREAD = 60
"""Minimum number of candidates spread over the sphere, besides the rests."""

SPREAD_PER_OUTCOME = 8
"""Minimum number of these for each outcome."""

DISTINCT = math.radians(10.0)
"""Minimum angle between candidates; half the angle between spread ones if that is smaller."""

SAMPLES = 300
"""Directions at which the body is set down."""

HEIGHTS = (120, 240)
"""Size of the table of heights, by latitude and longitude: every 1.5 degrees."""

ARC_DIRECTIONS = 24
"""Directions on each great arc."""

OPPOSITE = 1e-9
"""Sine of the angle below which two directions count as opposite or equal."""

SOFTNESS = 0.01
"""Softness of assignments: extra climb, over the circumscribed radius, that they may take."""

BALANCINGS = 30
"""Iterations that balance the shares."""

MAX_SETS = 100_000
"""Maximum number of sets of candidates; if there are more, random ones, and fewer for more than
`FEW` outcomes."""

FEW = 4
"""Number of outcomes for which `MAX_SETS` sets fit into memory."""

MAX_ASSIGNED = 3_000
"""Maximum number of sets whose assignments are computed, the cheapest for any shares."""

MAX_ORDERED = 200
"""Maximum number of sets whose candidates are assigned to the outcomes in every order."""

MAX_ORDERS = 24
"""Number of orders above which only the order by natural shares is tried."""

EXCHANGES = 2
"""Rounds that exchange one candidate of each of the best random sets."""

LOOSENING = 0.85
"""Factor of the required angle if no set of candidates is as far apart."""

MAX_CHOICES = 60
"""Maximum number of choices."""

DIFFERENT = math.cos(math.radians(18.0))
"""Largest cosine between two choices, in the outcome that differs most."""


def outcome_choices(hull: ConvexHull, target: Floats, apart: float, seed: int) -> list[Floats]:
    """Choices of (k, 3) unit directions for the outcomes, the cheapest first.

    Parameters
    ----------
    hull: hull of circumscribed radius about 1, with the center of mass at the origin.
    target: (k,) target probabilities.
    apart: minimum angle between two directions of a choice, in radians, if any are so far apart.
    seed: seed of the spread candidates and of random sets.

    Raises
    ------
    InputError: a hull with as many vertices has fewer facets than there are outcomes.
    """
    count = len(target)
    most = 2 * len(hull.vertices) - 4
    if count > most:
        raise InputError(
            f"target: expected at most {most} outcomes for a hull of {len(hull.vertices)} corners, "
            f"got {count}; join some, or take a surface with more corners"
        )
    random = np.random.default_rng([seed, count])
    # The rests, the most probable first, and directions between them.
    rests = analyze(hull, np.zeros(3), "given").normals
    spread = _spread(max(MIN_SPREAD, SPREAD_PER_OUTCOME * count), random)
    least = min(DISTINCT, 0.5 * math.sqrt(4.0 * math.pi / len(spread)))
    candidates = np.zeros((0, 3))
    for direction in (*rests, *spread):
        if (candidates @ direction).max(initial=-1.0) <= math.cos(least):
            candidates = np.vstack([candidates, direction])
    costs = _look_up_climbs(hull.vertices, _spread(SAMPLES, random), candidates)
    # The most probable outcome first, as the candidates of a set are ordered by natural shares.
    order = np.argsort(-target, kind="stable")
    shares = target[order]
    sets = _find_sets(costs, candidates, count, apart, shares, random)
    prices, sets = _order_sets(costs, sets, shares)
    is_equal = target[:, None] == target
    chosen: list[Floats] = []
    for place in np.argsort(prices, kind="stable"):
        directions = np.empty((count, 3))
        directions[order] = candidates[sets[place]]
        # Outcomes of equal probability are interchangeable.
        cosines = [np.where(is_equal, directions @ other.T, -1.0) for other in chosen]
        if all(
            min(cosine.max(axis=1).min(), cosine.max(axis=0).min()) < DIFFERENT
            for cosine in cosines
        ):
            chosen.append(directions)
        if len(chosen) == MAX_CHOICES:
            break
    return chosen


def _spread(count: int, random: np.random.Generator) -> Floats:
    """(count, 3) even directions over the sphere, rotated at random."""
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    return np.asarray(even_directions(count) @ axes)


def _look_up_climbs(vertices: Floats, starts: Floats, ends: Floats) -> Floats:
    """(s, e) largest rise of the height along the great arc from each direction to each end; 0 if
    it only falls. Heights are looked up in a table."""
    rows, columns = HEIGHTS
    latitude = (np.arange(rows) + 0.5) * math.pi / rows
    longitude = (np.arange(columns) + 0.5) * 2.0 * math.pi / columns - math.pi
    table = np.empty(HEIGHTS)
    for row, angle in enumerate(latitude.tolist()):
        circle = math.sin(angle) * np.stack([np.cos(longitude), np.sin(longitude)])
        ring = np.stack([*circle, np.full(columns, math.cos(angle))], axis=1)
        table[row] = (ring @ vertices.T).max(axis=1)
    x, y, z = np.moveaxis(_great_arcs(starts, ends), -1, 0)
    row = np.minimum(np.arccos(np.clip(z, -1.0, 1.0)) / math.pi * rows, rows - 1)
    turn = np.minimum((np.arctan2(y, x) + math.pi) / (2.0 * math.pi) * columns, columns - 1)
    heights = table[row.astype(np.int64), turn.astype(np.int64)]
    later = np.maximum.accumulate(heights[..., ::-1], axis=-1)[..., ::-1]
    return np.asarray((later - heights).max(axis=-1))


def _great_arcs(starts: Floats, ends: Floats) -> Floats:
    """(s, e, `ARC_DIRECTIONS`, 3) directions from each start (s, 3) to each end (e, 3), both
    included; any great arc for opposite ones, as all are equally long."""
    first, last = starts[:, None], np.broadcast_to(ends, (len(starts), *ends.shape))
    aside = last - (first * last).sum(-1, keepdims=True) * first
    opposite = norms(aside) < OPPOSITE
    if opposite.any():
        first_of = np.broadcast_to(first, last.shape)[opposite]
        axes = np.eye(3)[np.abs(first_of).argmin(axis=1)]
        aside[opposite] = np.linalg.cross(first_of, axes)
    turns = angle_between(first, last)[..., None] * np.linspace(0.0, 1.0, ARC_DIRECTIONS)
    turns, across = turns[..., None], unit_vectors(aside)[:, :, None]
    return np.asarray(np.cos(turns) * first[:, :, None] + np.sin(turns) * across)


def _find_sets(
    costs: Floats,
    candidates: Floats,
    count: int,
    apart: float,
    shares: Floats,
    random: np.random.Generator,
) -> Integers:
    """(m, k) cheapest sets of candidates that are far enough apart, by natural shares."""
    cosines = candidates @ candidates.T
    is_complete = math.comb(len(candidates), count) <= MAX_SETS and count <= FEW
    sets = np.zeros((0, count), dtype=np.int64)
    while len(sets) == 0:
        near = cosines > math.cos(apart) + 1e-12
        np.fill_diagonal(near, True)
        if is_complete:
            sets = np.array(list(combinations(range(len(near)), count)), dtype=np.int64)
            for one, other in combinations(range(count), 2):
                sets = sets[~near[sets[:, one], sets[:, other]]]
        else:
            sets = _draw_sets(near, count, random)
        apart *= LOOSENING
    sets = _keep_cheapest(costs, sets)
    for _ in range(0 if is_complete else EXCHANGES):
        prices = _assign_samples(costs, _sort_by_share(costs, sets), shares)
        best = sets[np.argsort(prices, kind="stable")[:MAX_ORDERED]]
        # One candidate of each exchanged for any other that is apart from the rest.
        exchanged = []
        for place in range(count):
            others = np.delete(best, place, axis=1)
            number, candidate = np.nonzero(~near[others].any(axis=1))
            exchanged.append(np.column_stack([others[number], candidate]))
        more = np.unique(np.sort(np.concatenate(exchanged), axis=1), axis=0)
        sets = np.unique(np.concatenate([best, _keep_cheapest(costs, more)]), axis=0)
    return sets


def _chunk(most: int, count: int) -> int:
    """Number of sets to compute together: `most` for few outcomes, and fewer for many, as the work
    grows with the square of their number."""
    return max(1, round(most * min(1.0, (FEW / count) ** 2)))


def _draw_sets(near: np.ndarray, count: int, random: np.random.Generator) -> Integers:
    """Random sets, drawn together, one candidate after the other."""
    drawn = _chunk(MAX_SETS, count)
    free = np.ones((drawn, len(near)), dtype=bool)
    sets = np.empty((drawn, count), dtype=np.int64)
    for place in range(count):
        sets[:, place] = np.where(free, random.random(free.shape), -1.0).argmax(axis=1)
        # A set without a free candidate gets a used one, and is dropped.
        is_valid = free[np.arange(len(sets)), sets[:, place]]
        free &= ~near[sets[:, place]]
        free, sets = free[is_valid], sets[is_valid]
    return np.unique(np.sort(sets, axis=1), axis=0)


def _keep_cheapest(costs: Floats, sets: Integers) -> Integers:
    """The cheapest sets if every direction may go to the nearest candidate."""
    bound = np.empty(len(sets))
    step = _chunk(MAX_ASSIGNED, sets.shape[1])
    for first in range(0, len(sets), step):
        part = slice(first, first + step)
        bound[part] = costs[:, sets[part]].min(axis=2).mean(axis=0)
    return sets[np.argsort(bound, kind="stable")[:MAX_ASSIGNED]]


def _sort_by_share(costs: Floats, sets: Integers) -> Integers:
    """Sets, each sorted by descending natural shares, the numbers of directions that are nearest to
    its candidates."""
    nearest = costs[:, sets].argmin(axis=2)
    natural = np.stack([(nearest == place).sum(axis=0) for place in range(sets.shape[1])], axis=1)
    return np.take_along_axis(sets, np.argsort(-natural, axis=1, kind="stable"), axis=1)


def _order_sets(costs: Floats, sets: Integers, shares: Floats) -> tuple[Floats, Integers]:
    """Costs (m,) of sets (m, k) in their cheapest orders."""
    ordered = _sort_by_share(costs, sets)
    prices = _assign_samples(costs, ordered, shares)
    if len(np.unique(shares)) == 1 or math.factorial(len(shares)) > MAX_ORDERS:
        return prices, ordered
    best = ordered[np.argsort(prices, kind="stable")[:MAX_ORDERED]]
    tried = np.concatenate([best[:, list(order)] for order in permutations(range(len(shares)))])
    return _assign_samples(costs, tried, shares), tried


def _assign_samples(costs: Floats, sets: Integers, shares: Floats) -> Floats:
    """(m,) cost of the cheapest assignment of the samples to sets (m, k) with their shares (k,).

    Source: Cuturi, Sinkhorn distances (NeurIPS 2013).
    """
    prices = np.empty(len(sets))
    step = _chunk(MAX_ASSIGNED, sets.shape[1])
    for first in range(0, len(sets), step):
        part = slice(first, first + step)
        climb = costs[:, sets[part]]
        kernel = np.exp(-climb / SOFTNESS) + 1e-300
        weights = np.ones(climb.shape[1:])
        for _ in range(BALANCINGS):
            rows = 1.0 / (len(costs) * np.einsum("smk,mk->sm", kernel, weights))
            weights = shares / np.einsum("smk,sm->mk", kernel, rows)
        flow = kernel * rows[:, :, None] * weights
        prices[part] = (flow * climb).sum(axis=(0, 2))
    return prices
