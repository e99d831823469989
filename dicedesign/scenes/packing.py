"""Places on a floor for footprints that may not meet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats
from dicedesign.scenes.footprints import Footprint, gap

__all__ = ["fitting_floor", "pack"]

CLEARANCE: Final = 1e-6
"""Least distance between two footprints, over the largest radius: far more than rounding."""

TRIES: Final = 24
"""Random places that are tried at once."""

ROUNDS: Final = 8
"""Of so many tries for each body, before all of the floor is looked at."""

MESH: Final = 24
"""Places along each side when all of the floor is looked at."""

BULK: Final = 1000
"""Footprints up to which all are looked at for all tries at once."""

FILLED: Final = 0.35
"""Part of a floor of our choice that is covered; up to two thirds can be."""

WIDER: Final = 1.1
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
    sides, layout = np.array(floor), _Layout(footprints)
    for k in np.argsort(-layout.outer, kind="stable").tolist():
        room = sides - np.ptp(footprints[k].corners, axis=0)
        if (room < 0.0).any():
            continue
        lowest = -sides / 2.0 - footprints[k].corners.min(axis=0)
        for tried in _tries(chance):
            if layout.place(k, lowest + tried * room):
                break
    return layout.shifts


class _Layout:
    """Footprints of which some have places.

    Discs about the middles of their boxes tell most pairs that meet, or do not, and those that are
    far away are not looked at: they are in cells that are no neighbors.

    Attributes
    ----------
    shifts: (n, 2) to the places, or NaN.
    middles: (n, 2) of their discs; outer, inner: (n,) radii of those around and within them.
    clearance: that two have to keep.
    """

    def __init__(self, footprints: Sequence[Footprint]) -> None:
        self.footprints = footprints
        self.shifts = np.full((len(footprints), 2), np.nan)
        corners = [footprint.corners for footprint in footprints]
        self.middles = np.array([(p.min(axis=0) + p.max(axis=0)) / 2.0 for p in corners])
        arms = [p - m for p, m in zip(corners, self.middles, strict=True)]
        self.outer = np.sqrt([(arm * arm).sum(-1).max() for arm in arms])
        within = zip(footprints, self.middles, strict=True)
        self.inner = np.array([footprint.room_around(m) for footprint, m in within])
        self.clearance = CLEARANCE * float(self.outer.max())
        self._cell = 2.0 * float(self.outer.max()) + self.clearance
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._placed: list[int] = []

    def place(self, k: int, shifts: Floats) -> bool:
        """Give a footprint the first of some shifts (t, 2) that leads to a free place, if any."""
        for shift in self._hopeful(k, shifts):
            column, row = np.floor((shift + self.middles[k]) / self._cell).astype(int).tolist()
            if self._is_free(k, shift, column, row):
                self.shifts[k] = shift
                self._cells.setdefault((column, row), []).append(k)
                self._placed.append(k)
                return True
        return False

    def _hopeful(self, k: int, shifts: Floats) -> Floats:
        """Those of the shifts (t, 2) that do not lead into a disc within another; all of them where
        there are many others, of which most are far away."""
        if not 0 < len(self._placed) <= BULK:
            return shifts
        others = self.shifts[self._placed] + self.middles[self._placed]
        between = (shifts + self.middles[k])[:, None] - others
        reached = (self.inner[k] + self.inner[self._placed]) ** 2
        return shifts[((between * between).sum(-1) > reached).all(axis=1)]

    def _is_free(self, k: int, shift: Floats, column: int, row: int) -> bool:
        """Whether a footprint that is shifted into a cell meets no other."""
        cells = ((column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1))
        others = np.array([n for cell in cells for n in self._cells.get(cell, ())], dtype=np.int64)
        between = shift + self.middles[k] - (self.shifts[others] + self.middles[others])
        squared = (between * between).sum(-1)
        near = squared < (self.outer[k] + self.outer[others] + self.clearance) ** 2
        # The nearest are the likeliest to be met.
        return all(
            gap(self.footprints[k], self.footprints[n], self.shifts[n] - shift) > self.clearance
            for n in others[near][np.argsort(squared[near])].tolist()
        )


def _tries(chance: np.random.Generator) -> Iterator[Floats]:
    """Places (t, 2) as parts of the room there is, from 0 to 1, in the order of trying."""
    for _ in range(ROUNDS):
        yield chance.random((TRIES, 2))
    grid = (np.arange(MESH) + chance.random()) / MESH
    yield chance.permutation(np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2))


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
