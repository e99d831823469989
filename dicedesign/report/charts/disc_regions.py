"""Regions of the sphere on the disc of a hemisphere."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.report.charts.hemispheres import Disc
from dicedesign.runtime.arrays import Floats

__all__ = ["region_on_disc"]

_RIM_STEP = math.radians(5.0)


def region_on_disc(disc: Disc, loops: Sequence[Floats], holds_rim: bool) -> list[Floats]:
    """Closed polygons on paper of the part of a region of the sphere that is on a disc.

    loops: its borders, closed, each (m, 3) unit directions without the first repeated, close
        together, the region on their left.
    holds_rim: whether the region holds the rim where no border crosses it.

    Returns a list of (p, 2) corners; of each the region is on the left.
    """
    whole: list[Floats] = []
    pieces: list[Floats] = []
    for loop in loops:
        inside = loop @ disc.axis >= 0.0
        if inside.all():
            whole.append(disc.project(loop))
        elif inside.any():
            pieces += _pieces(disc, loop)
    if pieces:
        whole += _along_rim(pieces)
    elif holds_rim:
        whole.append(_rim(0.0, 2.0 * math.pi)[:-1])
    return whole


def _pieces(disc: Disc, loop: Floats) -> list[Floats]:
    """The parts (m, 2) on a disc of a loop that crosses its rim, from rim to rim."""
    start = int(np.flatnonzero(loop @ disc.axis < 0.0)[0])
    opened = np.roll(loop, -start, axis=0)
    return disc.lines(np.concatenate([opened, opened[:1]])[None])


def _along_rim(pieces: Sequence[Floats]) -> list[Floats]:
    """Polygons of lines (m, 2) from rim to rim: from the end of each counter-clockwise along the
    rim to where the next begins."""
    begins = np.array([math.atan2(piece[0, 1], piece[0, 0]) for piece in pieces])
    ends = np.array([math.atan2(piece[-1, 1], piece[-1, 0]) for piece in pieces])
    ahead = (begins[None, :] - ends[:, None]) % (2.0 * math.pi)
    follower = ahead.argmin(axis=1).tolist()
    polygons = []
    left = set(range(len(pieces)))
    while left:
        piece = min(left)
        parts = []
        while piece in left:
            left.remove(piece)
            parts += [pieces[piece], _rim(ends[piece], ahead[piece, follower[piece]])]
            piece = follower[piece]
        polygons.append(np.concatenate(parts))
    return polygons


def _rim(start: float, turn: float) -> Floats:
    """Points (m, 2) of the unit circle from an angle counter-clockwise, with both ends."""
    angles = start + np.linspace(0.0, turn, 2 + int(turn / _RIM_STEP))
    return unit_vectors(np.stack([np.cos(angles), np.sin(angles)], axis=1))
