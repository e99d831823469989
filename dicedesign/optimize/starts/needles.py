"""Long starting shapes for any probabilities: a needle rolls around its axis like its
cross-section.

A corner of the section that is farther from the center of mass than its neighbors separates two
basins, so the angles between such corners are the probabilities. In each basin, sides come nearer
to the center from both ends to the rest. The body rolls on over each of them, as the foot of the
center on its line is beyond its lower corner. A section of even thickness cannot do so in a basin
wider than half a turn. But the ends of the needle are slanted: it is longer on one side of the
section, which moves the center of mass to the right place. J. H. Conway and R. K. Guy, Stability of
polyhedra, SIAM Review 11 (1969) 78-82, found the first body of this kind.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dicedesign.optimize.starts.shapes import start_with_probabilities
from dicedesign.optimize.starts.start import Start
from dicedesign.runtime.arrays import Floats, Integers

HALF_LENGTHS = (1.5, 15.0)
"""Range of half the length of a needle, over the largest radius of its section."""

LEADS = (0.01, 0.08)
"""Range of the angle, seen from the center, between the lower corner of a side that is no rest and
the foot of the center on its line."""

PARTS = (0.4, 0.6)
"""Range of the part of a basin before its rest."""

CLOSING_PARTS = (0.25, 0.75)
"""Range of the part of the largest basin before its rest, which closes the section."""

TURNS = ((0.2, 0.8), (0.35, 1.4))
"""Ranges of the largest angle between consecutive corners, in the largest basin and in others."""

LEAN = 0.3
"""Size of the random difference in the slopes of the two ends."""

WIDEST = 1.5
"""Largest angle between the foot of the center on the line of a side and the upper corner of the
side."""

THINNEST = 0.02
"""Least length of the needle, over the length at its center of mass."""

DRAWN = 24
"""Limit on the needles tried, the shortest first."""

CORRECTIONS = 6
"""Limit on the corrections of a section for the effect of the ends."""

CLOSE = (1e-3, 0.2)
"""Largest difference in probabilities of a needle near the target: absolute, and over the smallest
probability."""

BISECTIONS = 40
"""Bisections for the place of the first rest."""


def needle_near(target: Floats, rng: np.random.Generator) -> Start | None:
    """Draw a needle with one rest for each outcome and no other, and probabilities near the target;
    None if no needle drawn is near.

    target: (k,) target probabilities, k at least 2.
    """
    largest = int(np.argmax(target))
    others = np.delete(np.arange(len(target)), largest)
    shortest, longest = HALF_LENGTHS
    lengths = shortest * (longest / shortest) ** rng.random(DRAWN)
    close = min(CLOSE[0], CLOSE[1] * float(target.min()))
    for length in np.sort(lengths).tolist():
        around = np.concatenate([[largest], rng.permutation(others)])
        wanted = target[around]
        parts = np.concatenate([[0.5], rng.uniform(*PARTS, size=len(wanted) - 1)])
        turns = np.full(len(wanted), rng.uniform(*TURNS[1]))
        turns[0] = rng.uniform(*TURNS[0])
        halves = 2.0 * np.pi * wanted[:, None] * np.stack([parts, 1.0 - parts], axis=1)
        # Sides (k, 2) of each basin before and after its rest.
        steps = np.maximum(np.ceil(halves / turns[:, None]).astype(np.int64) - 1, 0)
        lead = rng.uniform(*LEADS)
        lean = LEAN * rng.normal(size=2) * rng.integers(0, 2)
        shares = wanted
        # Correct the basins by the errors of the probabilities.
        for _ in range(CORRECTIONS):
            section = _section(2.0 * np.pi * shares, parts, steps, lead)
            needle = None if section is None else _half_spaces(*section[:2], length, lean)
            candidate = None if needle is None else start_with_probabilities(*needle, len(wanted))
            if section is None or candidate is None or not np.array_equal(candidate[2], section[2]):
                break
            start, probabilities, _ = candidate
            if np.abs(probabilities - wanted).max() < close:
                return replace(start, directions=start.directions[np.argsort(around)])
            shares = np.maximum(shares + wanted - probabilities, shares / 3.0)
            shares = shares / shares.sum()
    return None


def _section(
    basins: Floats, parts: Floats, steps: Integers, lead: float
) -> tuple[Floats, Floats, Integers] | None:
    """Sides of a cross-section whose basins have angles (k,) around the axis, the largest first:
    angles (m,) of the normals, distances (m,) from the center, and the numbers of the rests (k,).
    None if the section cannot be closed, or a side is too wide.

    parts: (k,) part of each basin before its rest. The first is replaced: it makes the last corner
    as far from the center as the first one. steps: (k, 2) sides before and after each rest; lead:
    see `LEADS`.
    """

    def growth(turn: Any) -> Any:
        """Logarithm of the ratio of the distances of the corners of a side that is no rest, with an
        angle between them."""
        return np.log(np.cos(lead) / np.cos(turn + lead))

    def climbs(halves: Floats, steps: Integers) -> Floats:
        """Logarithms (...) of the ratio of the distances of the last corner of a basin and its
        rest, for angles (...) and numbers of sides (...) between them."""
        turns = halves / (steps + 1.0)
        climbs: Floats = steps * growth(turns) - np.log(np.cos(turns))
        return climbs

    def flight(half: float, steps: int) -> tuple[Floats, Floats]:
        """Sides between a rest and the end of its basin: angles (steps,) between their normals and
        the normal of the rest, and logarithms of their distances over the distance of the rest."""
        turn, number = half / (steps + 1.0), np.arange(steps, dtype=np.float64)
        first = np.log(np.cos(lead) / np.cos(turn))
        return (number + 1.0) * turn - lead, first + number * growth(turn)

    def excess(part: float) -> float:
        halves[0] = basins[0] * np.array([part, 1.0 - part])
        return others + float(np.diff(climbs(halves[0], steps[0]))[0])

    low, high = CLOSING_PARTS
    halves = basins[:, None] * np.stack([parts, 1.0 - parts], axis=1)
    halves[0] = high * basins[0]
    if (halves / (steps + 1.0) + lead > WIDEST).any():
        return None
    others = float(np.diff(climbs(halves[1:], steps[1:])).sum())
    if not excess(low) > 0.0 > excess(high):
        return None
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    # The last corner of a basin is the first one of the next.
    ways = climbs(halves, steps)
    rest_heights = np.cumsum(np.concatenate([[0.0], ways[:-1, 1]]) - ways[:, 0])
    angles: list[Floats] = []
    heights: list[Floats] = []
    for half, few, end, height in zip(
        halves.tolist(), steps.tolist(), np.cumsum(basins), rest_heights, strict=True
    ):
        before, after = (flight(*way) for way in zip(half, few, strict=True))
        rest = end - half[1]
        angles += [rest - before[0][::-1], rest[None], rest + after[0]]
        heights += [height + before[1][::-1], height[None], height + after[1]]
    rests = np.cumsum(steps.sum(axis=1) + 1) - 1 - steps[:, 1]
    return np.concatenate(angles), np.exp(np.concatenate(heights)), rests


def _half_spaces(
    angles: Floats, distances: Floats, length: float, lean: Floats
) -> tuple[Floats, Floats] | None:
    """Normals (m + 2, 3) and distances (m + 2,) of the sides of a section, given in order, and of
    two ends whose slant puts the center of mass on the axis. None if the sides make no convex
    polygon, or the needle is thinner than `THINNEST`.

    length: see `HALF_LENGTHS`; lean: (2,) difference of the slopes of the ends from their mean, in
    units of the least length of the needle, over its length at the center and the largest radius.
    """
    normals = np.column_stack([np.cos(angles), np.sin(angles)])
    following, beyond = np.roll(normals, -1, axis=0), np.roll(distances, -1)
    sine = normals[:, 0] * following[:, 1] - normals[:, 1] * following[:, 0]
    if not (sine > 0.0).all():
        return None
    corners = distances[:, None] * following[:, ::-1] - beyond[:, None] * normals[:, ::-1]
    corners *= np.array([1.0, -1.0]) / sine[:, None]
    before = np.roll(corners, 1, axis=0)
    along = corners - before
    if not (normals[:, 0] * along[:, 1] > normals[:, 1] * along[:, 0]).all():
        return None
    # The polygon with a density of 1 - slope . x has its center of mass at the origin.
    areas = before[:, 0] * corners[:, 1] - before[:, 1] * corners[:, 0]
    both = before + corners
    first = (areas[:, None] * both).sum(0) / 6.0
    terms = [(areas[:, None] * x).T @ x for x in (both, before, corners)]
    slope = np.linalg.solve((terms[0] + terms[1] + terms[2]) / 24.0, first)
    shortest = float((1.0 - corners @ slope).min())
    if shortest < THINNEST:
        return None
    radius = float(np.sqrt((corners * corners).sum(-1).max()))
    length, lean = length * radius, shortest / radius * lean
    ends = [[1.0, *(length * (slope + lean))], [-1.0, *(length * (slope - lean))]]
    sides = np.column_stack([np.zeros(len(normals)), normals])
    return np.concatenate([sides, ends]), np.concatenate([distances, [length, length]])
