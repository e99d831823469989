"""Places on a floor for footprints, convex polygons that may not meet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex polygon.

    Attributes
    ----------
    corners: (m, 2), counter-clockwise.
    outward: (e, 2) outward unit normals of its edges.
    reach: (e,) how far it reaches along them.
    """

    corners: Floats
    outward: Floats
    reach: Floats

    @classmethod
    def under(cls, points: Floats) -> Footprint:
        """The convex hull of points (n, 2) that are not all on one line."""
        corners = _convex_polygon(points)
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(edges[:, 0], edges[:, 1])[:, None]
        outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths
        # Beyond all corners, not just the edge's own: the shortest edges have any direction.
        return cls(corners, outward, (corners @ outward.T).max(axis=0))

    @property
    def area(self) -> float:
        x, y = (self.corners - self.corners[0]).T
        return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def gap(one: Footprint, other: Footprint, shift: Floats) -> float:
    """The widest strip beside an edge of one of two footprints, the other of them shifted by (2,),
    that has them on different sides; 0 or less where they meet.

    Convex polygons that do not meet always have such a strip beside one of their edges.
    """
    beside_one = (other.corners @ one.outward.T).min(axis=0) + one.outward @ shift - one.reach
    beside_other = (one.corners @ other.outward.T).min(axis=0) - other.outward @ shift - other.reach
    return float(max(beside_one.max(), beside_other.max()))


def _convex_polygon(points: Floats) -> Floats:
    """Corners (m, 2) of the convex hull of points (n, 2), counter-clockwise.

    Source: A. M. Andrew, Inf. Process. Lett. 9(5), 1979 (the monotone chain).
    """
    ordered = np.unique(points, axis=0).tolist()
    chains: list[list[list[float]]] = []
    for row in (ordered, ordered[::-1]):
        chain: list[list[float]] = []
        for x, y in row:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2], chain[-1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append([x, y])
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


CLEARANCE = 1e-6
"""Least distance between two footprints, over the largest radius: far more than rounding."""

ROUNDS, TRIES = 8, 24
"""Times that so many random places are drawn for each body before all of the floor is looked at."""

MESH = 24
"""Places along each side when all of the floor is looked at."""

FILLED = 0.35
"""Part of a floor of our choice that is covered; up to two thirds can be."""

WIDER = 1.1
"""Each side of the next floor that is tried over that of the last."""


def pack(
    footprints: Sequence[Footprint], floor: tuple[float, float], chance: np.random.Generator
) -> Floats:
    """Shifts (n, 2) of footprints to places on a floor where no two meet; NaN for those that found
    none.

    The largest come first. Each is tried at random places, then at those of a mesh over all of the
    floor in random order.

    floor: its sides along x and y, around the origin.
    """
    sides, shifts = np.array(floor), np.full((len(footprints), 2), np.nan)
    # Discs about the middles of their boxes tell most pairs that do not meet, and those that are
    # far away are not looked at: they are in cells that are no neighbors.
    corners = [footprint.corners for footprint in footprints]
    middles = np.array([(p.min(axis=0) + p.max(axis=0)) / 2.0 for p in corners])
    arms = [p - m for p, m in zip(corners, middles, strict=True)]
    outer = np.sqrt([(arm * arm).sum(-1).max() for arm in arms])
    clearance = CLEARANCE * float(outer.max())
    size = 2.0 * float(outer.max()) + clearance
    cells: dict[tuple[int, int], list[int]] = {}

    def is_free(k: int, shift: Floats, column: int, row: int) -> bool:
        """Whether a footprint that is shifted into a cell meets no other."""
        around = ((column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1))
        others = np.array([n for cell in around for n in cells.get(cell, ())], dtype=np.int64)
        between = shift + middles[k] - (shifts[others] + middles[others])
        squared = (between * between).sum(-1)
        near = squared < (outer[k] + outer[others] + clearance) ** 2
        # The nearest are the likeliest to be met.
        return all(
            gap(footprints[k], footprints[n], shifts[n] - shift) > clearance
            for n in others[near][np.argsort(squared[near])].tolist()
        )

    for k in np.argsort(-outer, kind="stable").tolist():
        room = sides - np.ptp(corners[k], axis=0)
        if (room < 0.0).any():
            continue
        for part in _tries(chance):
            shift = part * room - sides / 2.0 - corners[k].min(axis=0)
            column, row = np.floor((shift + middles[k]) / size).astype(int).tolist()
            if is_free(k, shift, column, row):
                shifts[k] = shift
                cells.setdefault((column, row), []).append(k)
                break
    return shifts


def _tries(chance: np.random.Generator) -> Iterator[Floats]:
    """Places (2,) as parts of the room there is, from 0 to 1, in the order of trying."""
    for _ in range(ROUNDS):
        yield from chance.random((TRIES, 2))
    grid = (np.arange(MESH) + chance.random()) / MESH
    yield from chance.permutation(np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2))


def fitting_floor(
    footprints: Sequence[Footprint],
    chance: np.random.Generator,
    proportions: tuple[float, float] = (4.0, 3.0),
) -> tuple[tuple[float, float], Floats]:
    """A floor with room for all footprints, and their shifts on it, as of `pack`.

    proportions: of its sides. It is not the smallest: about a third of it is covered.
    """
    extents = np.array([np.ptp(footprint.corners, axis=0) for footprint in footprints])
    covered = sum(footprint.area for footprint in footprints)
    unit = np.array(proportions) / np.sqrt(proportions[0] * proportions[1])
    scale = max(np.sqrt(covered / FILLED), float((extents / unit).max()))
    while True:
        floor = (_rounded_up(scale * unit[0]), _rounded_up(scale * unit[1]))
        shifts = pack(footprints, floor, chance)
        if not np.isnan(shifts).any():
            return floor, shifts
        scale *= WIDER


def _rounded_up(length: float) -> float:
    """A length in three digits, so that it can be told."""
    place = math.floor(math.log10(length)) - 2
    return float(f"{math.ceil(length / 10.0**place)}e{place}")
