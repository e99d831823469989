"""Long starting shapes for any odds: a needle rolls about its axis as its cross-section does.

A corner of the section that is farther from the center of mass than its neighbours parts two
basins, so the angles between such corners are the odds. In each basin, sides come nearer to the
center from both ends to the rest. The body rolls on over each of them, as the foot of the center on
its line lies beyond its lower corner. A section of even thickness could not do so in a basin wider
than half a turn. But the ends of the needle are slanted: it is longer on one side of the section
than on the other, which moves the center of mass to where it is wanted. The first body of this kind
is by J. H. Conway and R. K. Guy, Stability of polyhedra, SIAM Review 11 (1969) 78-82.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from dicedesign.optimize.starts.half_space_odds import resting_half_spaces, start_with_odds
from dicedesign.optimize.starts.start import Start
from dicedesign.runtime.arrays import Floats, Integers

HALF_LENGTHS: Final = (1.5, 15.0)
"""Range of half the length of a needle, over the largest radius of its section."""

LEADS: Final = (0.01, 0.08)
"""Range of the angle between the lower corner of a side that is no rest and the foot of the center
on its line, seen from the center."""

PARTS: Final = (0.4, 0.6)
"""Range of the part of a basin that lies before its rest."""

CLOSING_PARTS: Final = (0.25, 0.75)
"""Range of the same in the largest basin, where it is what closes the section."""

TURNS: Final = ((0.2, 0.8), (0.35, 1.4))
"""Ranges of the largest angle between consecutive corners, in the largest basin and in others."""

LEAN: Final = 0.3
"""Size of random differences in the slopes of the two ends."""

WIDEST: Final = 1.5
"""Largest angle between the foot of the center on the line of a side and the side's upper corner.
"""

THINNEST: Final = 0.02
"""Length of the needle where it is shortest, over that at its center of mass."""

DRAWN: Final = 24
"""Needles tried, the shortest first, until one is near the target."""

CORRECTIONS: Final = 6
"""How often a section is corrected for what the ends do to the odds."""

CLOSE: Final = 1e-3
"""Largest difference in odds of a needle that is near the target,"""

CLOSE_PART: Final = 0.2
"""and the same over the smallest probability."""

BISECTIONS: Final = 40
"""Halvings of the range in which the first rest is looked for."""


@dataclass(frozen=True)
class _Needle:
    """A needle but for the angles of its basins, which follow each other around the axis.

    Attributes
    ----------
    parts: (k - 1,) part of each basin but the first that lies before its rest.
    steps: (k, 2) sides of each basin before and after its rest.
    lead: see `LEADS`.
    length: see `HALF_LENGTHS`.
    lean: (2,) what the slope of one end has more, and that of the other less, than their mean, in
        units of the least length of the needle over that at its center and over the largest radius.
    """

    parts: Floats
    steps: Integers
    lead: float
    length: float
    lean: Floats

    def half_spaces(self, shares: Floats) -> tuple[Floats, Floats, Integers] | None:
        """Normals (m, 3), distances (m,) and the numbers of the rests (k,) for basins of such parts
        of a turn (k,); None where that makes no needle."""
        section = self._section(2.0 * np.pi * shares)
        if section is None:
            return None
        angles, distances, rests = section
        normals = np.column_stack([np.cos(angles), np.sin(angles)])
        corners = _corners(normals, distances)
        slope = None if corners is None else _slope(corners)
        if corners is None or slope is None:
            return None
        radius = float(np.sqrt((corners * corners).sum(-1).max()))
        shortest = float((1.0 - corners @ slope).min())
        length, lean = self.length * radius, shortest / radius * self.lean
        ends = [[1.0, *(length * (slope + lean))], [-1.0, *(length * (slope - lean))]]
        sides = np.column_stack([np.zeros(len(normals)), normals])
        return np.concatenate([sides, ends]), np.concatenate([distances, [length, length]]), rests

    def _section(self, basins: Floats) -> tuple[Floats, Floats, Integers] | None:
        """Angles (m,) of the normals of the sides, their distances (m,) from the center, and the
        numbers of the rests (k,)."""
        halves = self._halves(basins)
        if halves is None:
            return None
        climbs = self._climbs(halves, self.steps)
        # The last corner of a basin is the first one of the next.
        rest_heights = np.cumsum(np.concatenate([[0.0], climbs[:-1, 1]]) - climbs[:, 0])
        angles: list[Floats] = []
        heights: list[Floats] = []
        for half, steps, end, height in zip(
            halves.tolist(), self.steps.tolist(), np.cumsum(basins), rest_heights, strict=True
        ):
            before, after = (self._flight(*way) for way in zip(half, steps, strict=True))
            rest = end - half[1]
            angles += [rest - before[0][::-1], rest[None], rest + after[0]]
            heights += [height + before[1][::-1], height[None], height + after[1]]
        rests = np.cumsum(self.steps.sum(axis=1) + 1) - 1 - self.steps[:, 1]
        return np.concatenate(angles), np.exp(np.concatenate(heights)), rests

    def _halves(self, basins: Floats) -> Floats | None:
        """(k, 2) angles of the basins before and after their rests. The first rest lies where it
        makes the last corner of the section as far from the center as the first one; None where it
        would lie out of range for that, or sides would be too wide."""
        low, high = CLOSING_PARTS
        parts = np.concatenate([[high], self.parts])
        halves = basins[:, None] * np.stack([parts, 1.0 - parts], axis=1)
        halves[0] = high * basins[0]
        if (halves / (self.steps + 1.0) + self.lead > WIDEST).any():
            return None
        others = float(np.diff(self._climbs(halves[1:], self.steps[1:])).sum())

        def excess(part: float) -> float:
            halves[0] = basins[0] * np.array([part, 1.0 - part])
            return others + float(np.diff(self._climbs(halves[0], self.steps[0]))[0])

        if not excess(low) > 0.0 > excess(high):
            return None
        for _ in range(BISECTIONS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
        return halves

    def _flight(self, half: float, steps: int) -> tuple[Floats, Floats]:
        """The sides on the way up from a rest to the end of its basin: angles (steps,) between
        their normals and that of the rest, and logarithms of their distances over its own."""
        turn = half / (steps + 1.0)
        first = np.log(np.cos(self.lead) / np.cos(turn))
        number = np.arange(steps, dtype=np.float64)
        angles = (number + 1.0) * turn - self.lead
        heights: Floats = first + number * self._growth(turn)
        return angles, heights

    def _climbs(self, halves: Floats, steps: Integers) -> Floats:
        """Logarithms (...) of the distance of the corner at the end of a basin over that of the
        rest, at angles (...) and with so many sides (...) between them."""
        turns = halves / (steps + 1.0)
        climbs: Floats = steps * self._growth(turns) - np.log(np.cos(turns))
        return climbs

    def _growth(self, turn: Any) -> Any:
        """Logarithm of the ratio of the distances of two corners of a side that is no rest, at an
        angle from each other."""
        return np.log(np.cos(self.lead) / np.cos(turn + self.lead))


def needle_near(target: Floats, rng: np.random.Generator) -> Start | None:
    """A random needle with one rest for each outcome and no other, whose odds are near the target;
    None where none of those that were drawn is.

    target: (k,) wanted probabilities, k at least 2.
    """
    largest = int(np.argmax(target))
    others = np.delete(np.arange(len(target)), largest)
    shortest, longest = HALF_LENGTHS
    lengths = shortest * (longest / shortest) ** rng.random(DRAWN)
    for length in np.sort(lengths).tolist():
        around = np.concatenate([[largest], rng.permutation(others)])
        start = _corrected(_drawn(target[around], length, rng), target[around])
        if start is not None:
            return replace(start, directions=start.directions[np.argsort(around)])
    return None


def _drawn(shares: Floats, length: float, rng: np.random.Generator) -> _Needle:
    """A random needle for basins of such shares (k,), the first of which is the largest."""
    parts = rng.uniform(*PARTS, size=len(shares) - 1)
    turns = np.full(len(shares), rng.uniform(*TURNS[1]))
    turns[0] = rng.uniform(*TURNS[0])
    before = np.concatenate([[0.5], parts])
    halves = 2.0 * np.pi * shares[:, None] * np.stack([before, 1.0 - before], axis=1)
    return _Needle(
        parts,
        np.maximum(np.ceil(halves / turns[:, None]).astype(np.int64) - 1, 0),
        rng.uniform(*LEADS),
        length,
        LEAN * rng.normal(size=2) * rng.integers(0, 2),
    )


def _corrected(needle: _Needle, wanted: Floats) -> Start | None:
    """A needle of such odds (k,): its basins are changed by what the odds lack until those are
    near. None where it has other rests on the way, or the odds do not come near."""
    close = min(CLOSE, CLOSE_PART * float(wanted.min()))
    shares = wanted
    for _ in range(CORRECTIONS):
        half_spaces = needle.half_spaces(shares)
        if half_spaces is None:
            return None
        normals, distances, rests = half_spaces
        if not np.array_equal(resting_half_spaces(normals, distances), rests):
            return None
        made = start_with_odds(normals, distances, rests)
        if made is None:
            return None
        start, odds = made
        if np.abs(odds - wanted).max() < close:
            return start
        shares = np.maximum(shares + wanted - odds, shares / 3.0)
        shares = shares / shares.sum()
    return None


def _corners(normals: Floats, distances: Floats) -> Floats | None:
    """(m, 2) corners of a polygon after each of its sides, given in order around the origin; None
    where they make no convex polygon."""
    following, beyond = np.roll(normals, -1, axis=0), np.roll(distances, -1)
    sine = normals[:, 0] * following[:, 1] - normals[:, 1] * following[:, 0]
    if not (sine > 0.0).all():
        return None
    corners = distances[:, None] * following[:, ::-1] - beyond[:, None] * normals[:, ::-1]
    corners *= np.array([1.0, -1.0]) / sine[:, None]
    along = corners - np.roll(corners, 1, axis=0)
    forward = normals[:, 0] * along[:, 1] - normals[:, 1] * along[:, 0]
    return corners if (forward > 0.0).all() else None


def _slope(corners: Floats) -> Floats | None:
    """(2,) slope g such that the polygon (m, 2) with a density of 1 - g . x has its center of mass
    at the origin; None where some of the density would be below `THINNEST`."""
    before = np.roll(corners, 1, axis=0)
    areas = before[:, 0] * corners[:, 1] - before[:, 1] * corners[:, 0]
    both = before + corners
    first = (areas[:, None] * both).sum(0) / 6.0
    terms = [(areas[:, None] * x).T @ x for x in (both, before, corners)]
    slope: Floats = np.linalg.solve((terms[0] + terms[1] + terms[2]) / 24.0, first)
    return slope if (1.0 - corners @ slope).min() >= THINNEST else None
