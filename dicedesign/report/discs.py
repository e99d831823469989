"""The Gauss map: two hemispheres of directions as equal-area discs, and the basins on them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.tracing import slide
from dicedesign.runtime.arrays import Floats, Integers

RIM_STEP: Final = math.radians(5.0)
"""Longest piece of an arc: straight on paper it is beside the arc by less than half a pixel."""

DISC_PIXELS: Final = 690.0
"""Of a disc's square, which is a little larger."""

MAP_SIZE: Final = (2.0 * DISC_PIXELS + 60.0, DISC_PIXELS + 195.0)
"""Pixels across and down of the figure of a Gauss map."""

LEAST_WRITTEN: Final = 0.01
"""Probability up to which a rest is not written on the map."""

CHUNK: Final = 20_000
"""Directions that are followed at a time."""


@dataclass(frozen=True)
class Disc:
    """The hemisphere around an axis, seen from outside, by Lambert's azimuthal projection.

    Areas on the disc are in proportion to areas on the sphere.

    Attributes
    ----------
    axis: (3,) unit direction of the centre.
    right, up: (3,) unit directions of the paper's x and y; right x up = axis.
    """

    axis: Floats
    right: Floats
    up: Floats

    def project(self, directions: Floats) -> Floats:
        """Points (..., 2) on paper of unit directions (..., 3), which may not be -axis."""
        flat = directions @ np.stack([self.right, self.up], axis=1)
        return flat / np.sqrt(1.0 + directions @ self.axis)[..., None]

    def directions(self, points: Floats) -> Floats:
        """Unit directions (..., 3) of points (..., 2) at most 1 from the disc's centre."""
        squared = (points * points).sum(-1)[..., None]
        flat = points @ np.stack([self.right, self.up])
        return flat * np.sqrt(2.0 - squared) + (1.0 - squared) * self.axis

    def pixels(self, size: int) -> Floats:
        """Unit directions (size, size, 3) of the centres of a grid over [-1, 1]^2, lowest row
        first; centres off the disc stand for the nearest point of its rim."""
        centres = (2.0 * np.arange(size) + 1.0) / size - 1.0
        points = np.stack(np.meshgrid(centres, centres), axis=-1)
        radii = np.sqrt((points * points).sum(-1))[..., None]
        return self.directions(points / np.maximum(radii, 1.0))

    def lines(self, arcs: Floats) -> list[Floats]:
        """Polylines on paper, each (m, 2), of the parts of polylines (k, n, 3) on this disc."""
        heights = arcs @ self.axis
        parts: list[Floats] = []
        for path, height in zip(arcs, heights, strict=True):
            inside = height >= 0.0
            if not inside.any():
                continue
            crossings = np.flatnonzero(inside[1:] != inside[:-1])
            fraction = height[crossings] / (height[crossings] - height[crossings + 1])
            rim = path[crossings] + fraction[:, None] * (path[crossings + 1] - path[crossings])
            rim = unit_vectors(rim)
            full = np.insert(path, crossings + 1, rim, axis=0)
            borders = crossings + 1 + np.arange(len(crossings))
            starts = np.concatenate([[0], borders])
            ends = np.concatenate([borders, [len(full) - 1]])
            first = 0 if inside[0] else 1
            parts += [
                self.project(full[a : b + 1])
                for a, b in zip(starts[first::2], ends[first::2], strict=True)
            ]
        return parts


def great_arcs(starts: Floats, ends: Floats, pieces: int) -> Floats:
    """Great arcs (k, pieces + 1, 3) between unit directions (k, 3) that are not opposite."""
    t = np.linspace(0.0, 1.0, pieces + 1)
    chord = norms(ends - starts)
    turns = (2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)) / math.pi)[:, None]
    back, forth = (1.0 - t) * np.sinc((1.0 - t) * turns), t * np.sinc(t * turns)
    points = back[..., None] * starts[:, None] + forth[..., None] * ends[:, None]
    return unit_vectors(points)


def choose_axis(minima: Floats) -> tuple[int, int, int]:
    """A short integer axis that keeps minima (k, 3) away from the rims of the two discs."""
    span = range(-2, 3)
    triples = [(x, y, z) for x in span for y in span for z in span]
    axes = [t for t in triples if t > (0, 0, 0) and math.gcd(*t) == 1]
    axes.sort(key=lambda t: sum(n < 0 for n in t))
    grid = np.array(axes, dtype=np.float64)
    nearest = np.abs(minima @ unit_vectors(grid).T).min(axis=0)
    # Long axes are harder to picture, so they have to be clearly better.
    return axes[int(np.argmax(np.round(nearest - 0.02 * norms(grid), 9)))]


def opposite_discs(axis: tuple[int, int, int]) -> tuple[Disc, Disc]:
    """The hemispheres around `axis` and its opposite, with the body's +z (or +y where the axis is
    z) upward on paper."""
    center = np.array(axis, dtype=np.float64)
    center /= np.sqrt(center @ center)
    upward = np.array([0.0, 1.0, 0.0] if axis[:2] == (0, 0) else [0.0, 0.0, 1.0])
    upward -= (upward @ center) * center
    upward /= np.sqrt(upward @ upward)
    right = np.cross(upward, center)
    return Disc(center, right, upward), Disc(-center, -right, upward)


@dataclass(frozen=True, eq=False)
class PlacedDisc:
    """A hemisphere on paper.

    Attributes
    ----------
    disc: the hemisphere; axis: (3,) short integer direction of its centre.
    middle: (2,) pixels of its centre; radius: in pixels.
    """

    disc: Disc
    axis: tuple[int, int, int]
    middle: Floats
    radius: float

    def on_paper(self, points: Floats) -> Floats:
        """Pixels (..., 2), the second downward, of points (..., 2) of the disc of radius 1."""
        return self.middle + self.radius * points * [1.0, -1.0]


def placed_discs(poses: RestPoses) -> tuple[PlacedDisc, PlacedDisc]:
    """The two hemispheres of the figure of a body, where the figure has them."""
    weighty = poses.probabilities >= min(LEAST_WRITTEN, poses.probabilities[0])
    x, y, z = choose_axis(poses.normals[weighty])
    one, other = opposite_discs((x, y, z))
    height, radius = 60.0 + DISC_PIXELS / 2.0, DISC_PIXELS / (2.0 * 1.02)
    left, right = 15.0 + DISC_PIXELS / 2.0, 45.0 + 1.5 * DISC_PIXELS
    return (
        PlacedDisc(one, (x, y, z), np.array([left, height]), radius),
        PlacedDisc(other, (-x, -y, -z), np.array([right, height]), radius),
    )


def lowest_corners(hull: ConvexHull, directions: Floats) -> Integers:
    """(k,) corner of a hull that is lowest where directions (k, 3) point down."""
    lowest = np.empty(len(directions), dtype=np.int64)
    arms = hull.vertices - hull.centroid
    for start in range(0, len(directions), CHUNK):
        part = directions[start : start + CHUNK]
        lowest[start : start + CHUNK] = np.argmax(part @ arms.T, axis=1)
    return lowest


def basin_of_directions(
    poses: RestPoses, directions: Floats, lowest: Integers | None = None
) -> Integers:
    """Index into `poses` of the rest reached from each direction.

    directions: (k, 3) unit vectors that point down in the body's frame; lowest: (k,) their
    `lowest_corners`, which do not depend on the center of mass, where they are known.
    Returns (k,).
    """
    equilibria = poses.morse.equilibria
    if lowest is None:
        lowest = lowest_corners(equilibria.hull, directions)
    rests = np.empty(len(directions), dtype=np.int64)
    for start in range(0, len(directions), CHUNK):
        part = slice(start, start + CHUNK)
        begun = lowest[part], directions[part], np.zeros(len(directions[part]))
        facets, _ = slide(equilibria, *begun)
        rests[part] = poses.morse.basin_of_facet[facets]
    return rests


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
    angles = start + np.linspace(0.0, turn, 2 + int(turn / RIM_STEP))
    return unit_vectors(np.stack([np.cos(angles), np.sin(angles)], axis=1))


def basin_outlines(poses: RestPoses) -> list[list[Floats]]:
    """For each rest the closed polygons (m, 2) of its basin, in pixels of the Gauss map.

    They are those of `gauss_map_figure`, on both discs; what winds around a point once is inside.
    """
    borders = _borders(poses)
    outlines: list[list[Floats]] = [[] for _ in poses.facets]
    for placed in placed_discs(poses):
        at_rim = int(basin_of_directions(poses, placed.disc.right[None])[0])
        for rest, outline in enumerate(outlines):
            regions = region_on_disc(placed.disc, borders.get(rest, ()), rest == at_rim)
            outline += [placed.on_paper(region) for region in regions]
    return outlines


def _borders(poses: RestPoses) -> dict[int, list[Floats]]:
    """The borders of basins by rest: loops (m, 3) of unit directions, the basin on their left."""
    maxima = poses.basins[0].paths.maxima.tolist()
    sides = poses.morse.saddle_basins.tolist()
    lines: dict[int, list[tuple[int, int, Floats]]] = {}
    for saddle, path in enumerate(_fine(poses.morse.polylines)):
        begin, end = maxima[2 * saddle + 1], maxima[2 * saddle]
        left, right = sides[saddle]
        lines.setdefault(left, []).append((begin, end, path))
        lines.setdefault(right, []).append((end, begin, path[::-1]))
    return {rest: _loops(own) for rest, own in lines.items()}


def _loops(lines: Iterable[tuple[int, int, Floats]]) -> list[Floats]:
    """Lines (m, 3) from one maximum to another, strung together until they close."""
    leaving: dict[int, list[tuple[int, Floats]]] = {}
    for begin, end, path in lines:
        leaving.setdefault(begin, []).append((end, path))
    loops = []
    for first in sorted(leaving):
        while leaving[first]:
            here, parts = first, []
            while leaving.get(here):
                here, path = leaving[here].pop()
                parts.append(path[:-1])
            loops.append(np.concatenate(parts))
    return loops


def _fine(paths: Iterable[Floats]) -> list[Floats]:
    """Great arcs (n, 3) with points between, so that none is longer than a step."""
    fine = []
    for path in paths:
        count = np.ceil(norms(path[1:] - path[:-1]) / RIM_STEP).astype(np.int64).clip(1)
        arcs: list[Floats] = [path] * len(count)
        for pieces in np.unique(count).tolist():
            some = np.flatnonzero(count == pieces)
            made = great_arcs(path[some], path[some + 1], pieces)
            for place, arc in zip(some.tolist(), made, strict=True):
                arcs[place] = arc[:-1]
        fine.append(np.concatenate([*arcs, path[-1:]]))
    return fine
