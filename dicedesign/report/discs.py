"""Gauss map as two equal-area discs, and the basins on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from contourpy import contour_generator
from numpy.typing import NDArray

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.report.paper import GAP, PAGE_WIDTH, POINTS
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers

MAP_TOP = 16.0
"""Height above the discs, for their titles, in points."""

LEAST_WRITTEN = 0.01
"""Probability above which a rest is labeled on the map."""

MAP_PIXELS = 345
"""Side of the grid of pixels of a disc."""

FINER = 3
"""Parts of the side of a pixel at the border of a basin, to find the border within the pixel."""


def disc_radius(width: float) -> float:
    """Radius in points of the two discs on a map of `width` inches."""
    return (POINTS * width - 3.0 * GAP) / 4.0


RADIUS = disc_radius(PAGE_WIDTH)
"""Radius of a disc on the map of the report, in points."""

MAP_SIZE = (POINTS * PAGE_WIDTH, MAP_TOP + 2.0 * RADIUS)
"""Width of the map of the report, and height down to the lower end of its discs, in points."""


@dataclass(frozen=True, eq=False)
class Disc:
    """Hemisphere around an axis, seen from outside, in Lambert's equal-area projection.

    The body's +z is upward on paper; +y if the axis is z.

    Attributes
    ----------
    short: axis, as small integers.
    middle: (2,) position of the center on the map, in points.
    radius: in points.
    """

    short: tuple[int, int, int]
    middle: Floats
    radius: float

    @property
    def frame(self) -> Floats:
        """(3, 3) unit directions to the right, upward and at the center of the disc."""
        upward = np.array([0.0, 1.0, 0.0] if self.short[:2] == (0, 0) else [0.0, 0.0, 1.0])
        right = np.cross(upward, self.short)
        return unit_vectors(np.stack([right, np.cross(self.short, right), self.short]))

    def heights(self, directions: Floats) -> Floats:
        """Heights (...) of unit directions (..., 3) along the axis; above 0 on the disc."""
        return np.asarray(directions @ self.frame[2])

    def project(self, directions: Floats) -> Floats:
        """Points (..., 2) of unit directions (..., 3), on the disc of radius 1 or around it.

        The direction opposite the axis has no point.
        """
        flat = directions @ self.frame[:2].T
        return flat / np.sqrt(1.0 + self.heights(directions))[..., None]

    def to_paper(self, points: Floats) -> Floats:
        """Places (..., 2) on the map, y downward, of points (..., 2) of the disc of radius 1."""
        return self.middle + self.radius * points * [1.0, -1.0]

    def directions(self, points: Floats) -> Floats:
        """Unit directions (..., 3) of points (..., 2) of the disc of radius 1.

        Off the disc they are those of the nearest points of the rim.
        """
        points = points / np.maximum(norms(points), 1.0)[..., None]
        squared = (points * points).sum(-1)[..., None]
        flat = points * np.sqrt(2.0 - squared)
        return np.asarray(np.concatenate([flat, 1.0 - squared], axis=-1) @ self.frame)


def great_arcs(starts: Floats, ends: Floats, pieces: int) -> Floats:
    """Great arcs (k, pieces + 1, 3) between unit directions (k, 3) that are not opposite."""
    t = np.linspace(0.0, 1.0, pieces + 1)
    chord = norms(ends - starts)
    turns = (2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)) / math.pi)[:, None]
    back, forth = (1.0 - t) * np.sinc((1.0 - t) * turns), t * np.sinc(t * turns)
    points = back[..., None] * starts[:, None] + forth[..., None] * ends[:, None]
    return unit_vectors(points)


def choose_axis(minima: Floats) -> tuple[int, int, int]:
    """Axis of small integers that keeps minima (k, 3) away from the rims of the two discs."""
    span = range(-2, 3)
    triples = [(x, y, z) for x in span for y in span for z in span]
    axes = [t for t in triples if t > (0, 0, 0) and math.gcd(*t) == 1]
    axes.sort(key=lambda t: sum(n < 0 for n in t))
    grid = np.array(axes, dtype=np.float64)
    nearest = np.abs(minima @ unit_vectors(grid).T).min(axis=0)
    # Larger integers are harder to picture, so they have to be clearly better.
    return axes[int(np.argmax(np.round(nearest - 0.02 * norms(grid), 9)))]


def place_discs(poses: RestPoses, width: float = PAGE_WIDTH) -> tuple[Disc, Disc]:
    """Two hemispheres of a body's Gauss map, in their places on a map of `width` inches."""
    weighty = poses.probabilities >= min(LEAST_WRITTEN, poses.probabilities[0])
    x, y, z = choose_axis(poses.normals[weighty])
    radius = disc_radius(width)
    height = MAP_TOP + radius
    return (
        Disc((x, y, z), np.array([GAP + radius, height]), radius),
        Disc((-x, -y, -z), np.array([2.0 * GAP + 3.0 * radius, height]), radius),
    )


@dataclass(frozen=True, eq=False)
class DiscBasins:
    """Basins on a disc of radius 1.

    Attributes
    ----------
    directions: (p, p, 3) unit directions of a grid of pixels over [-1, 1]^2, lowest row first.
    rests: (p, p) rests that are reached from them.
    outlines: polygons (m, 2) around the basin of each rest. A point of the disc is in the basin if
        it is within an odd number of them. Beyond the rim they have no meaning.
    """

    directions: Floats
    rests: Integers
    outlines: list[list[Floats]]


@lru_cache(maxsize=1)
def map_basins(poses: RestPoses) -> tuple[DiscBasins, DiscBasins]:
    """Basins of a body on the two discs of its Gauss map."""
    one, other = (_trace_basins(poses, disc) for disc in place_discs(poses))
    return one, other


def _trace_basins(poses: RestPoses, disc: Disc) -> DiscBasins:
    centers = (2.0 * np.arange(MAP_PIXELS) + 1.0) / MAP_PIXELS - 1.0
    points = np.stack(np.meshgrid(centers, centers), axis=-1)
    directions = disc.directions(points)
    rests = poses.morse.basins_of(directions.reshape(-1, 3)).reshape(len(points), -1)
    # A pixel at a border belongs in part to either side.
    at_border = border_pixels(rests)
    parts = (np.arange(FINER) - (FINER - 1) / 2.0) * 2.0 / (FINER * MAP_PIXELS)
    shifts = np.stack(np.meshgrid(parts, parts), axis=-1).reshape(-1, 2)
    finer = disc.directions(points[at_border][:, None] + shifts)
    finer_rests = poses.morse.basins_of(finer.reshape(-1, 3)).reshape(-1, len(shifts))
    padded = np.concatenate(
        [centers[:1] - 2.0 / MAP_PIXELS, centers, centers[-1:] + 2.0 / MAP_PIXELS]
    )
    outlines = []
    for rest in range(len(poses.facets)):
        shares = (rests == rest).astype(np.float64)
        shares[at_border] = (finer_rests == rest).mean(axis=1)
        contours = contour_generator(padded, padded, np.pad(shares, 1))
        outlines.append([np.asarray(ring) for ring in contours.lines(0.5)] if shares.any() else [])
    return DiscBasins(directions, rests, outlines)


def border_pixels(rests: Integers) -> NDArray[np.bool_]:
    """(p, p) whether a pixel has a neighbor in its row or column that leads to another rest."""
    at_border = np.zeros(rests.shape, dtype=bool)
    across, along = rests[1:] != rests[:-1], rests[:, 1:] != rests[:, :-1]
    at_border[1:] |= across
    at_border[:-1] |= across
    at_border[:, 1:] |= along
    at_border[:, :-1] |= along
    return at_border


def basin_outlines(
    poses: RestPoses, width: float = PAGE_WIDTH
) -> list[tuple[Disc, list[list[Floats]]]]:
    """For each disc of a Gauss map of `width` inches, and each rest, polygons (m, 2) around its
    basin, in points of the map; see `DiscBasins.outlines`."""
    return [
        (disc, [[disc.to_paper(ring) for ring in rings] for rings in basins.outlines])
        for disc, basins in zip(place_discs(poses, width), map_basins(poses), strict=True)
    ]


def svg_path(rings: Sequence[Floats]) -> str:
    """Path of closed polygons (m, 2) in SVG."""
    texts = (" ".join(f"{x:.1f},{y:.1f}" for x, y in ring.tolist()) for ring in rings)
    return "".join(f"M{text}Z" for text in texts)
