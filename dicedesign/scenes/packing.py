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

FILLED: Final = 0.35
"""Part of a floor of our choice that is covered: half is about what bodies at random places can
cover at most."""

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

    Discs about the middles of their boxes tell most pairs that meet, or do not.

    Attributes
    ----------
    shifts: (n, 2) to the places, or NaN; placed: which have places.
    middles: (n, 2) of their discs; outer, inner: (n,) radii of those around and within them.
    clearance: that two have to keep.
    """

    def __init__(self, footprints: Sequence[Footprint]) -> None:
        self.footprints = footprints
        self.shifts = np.full((len(footprints), 2), np.nan)
        self.placed: list[int] = []
        corners = [footprint.corners for footprint in footprints]
        self.middles = np.array([(p.min(axis=0) + p.max(axis=0)) / 2.0 for p in corners])
        arms = [p - m for p, m in zip(corners, self.middles, strict=True)]
        self.outer = np.sqrt([(arm * arm).sum(-1).max() for arm in arms])
        within = zip(footprints, self.middles, strict=True)
        self.inner = np.array([footprint.room_around(m) for footprint, m in within])
        self.clearance = CLEARANCE * float(self.outer.max())

    def place(self, k: int, shifts: Floats) -> bool:
        """Give a footprint the first of some shifts (t, 2) that leads to a free place, if any."""
        others = np.array(self.placed, dtype=np.int64)
        between = (shifts + self.middles[k])[:, None] - (self.shifts + self.middles)[others]
        squared = (between * between).sum(-1)
        meets = (squared <= (self.inner[k] + self.inner[others]) ** 2).any(axis=1)
        apart = squared >= (self.outer[k] + self.outer[others] + self.clearance) ** 2
        for t in np.flatnonzero(~meets).tolist():
            near = np.flatnonzero(~apart[t])
            own = self.footprints[k]
            if all(
                gap(own, self.footprints[n], self.shifts[n] - shifts[t]) > self.clearance
                # The nearest are the likeliest to be met.
                for n in others[near[np.argsort(squared[t, near])]].tolist()
            ):
                self.shifts[k] = shifts[t]
                self.placed.append(k)
                return True
        return False


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
