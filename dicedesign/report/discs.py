"""Gauss map as two equal-area discs, and the basins on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from contourpy import contour_generator

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.tracing import slide
from dicedesign.runtime.arrays import Floats, Integers

DISC_PIXELS = 690.0
"""Side of the square around a disc."""

MAP_SIZE = (2.0 * DISC_PIXELS + 60.0, DISC_PIXELS + 195.0)
"""Width and height, in pixels, of the figure of a Gauss map."""

RADIUS = DISC_PIXELS / (2.0 * 1.02)
"""Radius of a disc, in pixels."""

LEAST_WRITTEN = 0.01
"""Probability above which a rest is labeled on the map."""

MAP_PIXELS = 345
"""Side of the grid of pixels of a disc."""

CHUNK = 20_000
"""Number of directions that are followed at a time, to limit memory."""


@dataclass(frozen=True, eq=False)
class Disc:
    """Hemisphere around an axis, seen from outside, in Lambert's equal-area projection.

    The body's +z is upward on paper; +y if the axis is z.

    Attributes
    ----------
    short: axis, as small integers.
    middle: (2,) position of the center on the map, in pixels.
    """

    short: tuple[int, int, int]
    middle: Floats

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
        """Pixels (..., 2) of the map, y downward, of points (..., 2) of the disc of radius 1."""
        return self.middle + RADIUS * points * [1.0, -1.0]

    def pixels(self, size: int) -> Floats:
        """Unit directions (size, size, 3) at grid centers over [-1, 1]^2, lowest row first.

        Off the disc they are at the nearest points of the rim.
        """
        centers = (2.0 * np.arange(size) + 1.0) / size - 1.0
        points = np.stack(np.meshgrid(centers, centers), axis=-1)
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


def place_discs(poses: RestPoses) -> tuple[Disc, Disc]:
    """Two hemispheres of a body's Gauss map, in their places on the figure."""
    weighty = poses.probabilities >= min(LEAST_WRITTEN, poses.probabilities[0])
    x, y, z = choose_axis(poses.normals[weighty])
    half, height = DISC_PIXELS / 2.0, 60.0 + DISC_PIXELS / 2.0
    return (
        Disc((x, y, z), np.array([15.0 + half, height])),
        Disc((-x, -y, -z), np.array([45.0 + 3.0 * half, height])),
    )


def lowest_corners(hull: ConvexHull, directions: Floats) -> Integers:
    """Lowest corners (k,) of a hull if directions (k, 3) point down."""
    lowest = np.empty(len(directions), dtype=np.int64)
    arms = hull.vertices - hull.centroid
    for start in range(0, len(directions), CHUNK):
        part = directions[start : start + CHUNK]
        lowest[start : start + CHUNK] = np.argmax(part @ arms.T, axis=1)
    return lowest


def basin_of_directions(
    poses: RestPoses, directions: Floats, lowest: Integers | None = None
) -> Integers:
    """Rest (k,) that is reached from each direction, as an index into `poses`.

    directions: (k, 3) unit vectors that point down in the body's frame; lowest: (k,) corners by
    `lowest_corners`, which do not depend on the center of mass, or None to compute them.
    """
    equilibria = poses.morse.equilibria
    if lowest is None:
        lowest = lowest_corners(equilibria.hull, directions)
    rests = np.empty(len(directions), dtype=np.int64)
    for start in range(0, len(directions), CHUNK):
        part = slice(start, start + CHUNK)
        exact = np.zeros(len(directions[part]))
        facets, _ = slide(equilibria, lowest[part], directions[part], exact)
        rests[part] = poses.morse.basin_of_facet[facets]
    return rests


@lru_cache(maxsize=1)
def map_basins(poses: RestPoses) -> list[tuple[Disc, Floats, Integers]]:
    """For each disc of the Gauss map, unit directions (p, p, 3) of a grid of pixels, lowest row
    first, and the rests (p, p) that are reached from them."""
    discs = place_discs(poses)
    grids = [disc.pixels(MAP_PIXELS) for disc in discs]
    rests = [basin_of_directions(poses, grid.reshape(-1, 3)) for grid in grids]
    squares = [own.reshape(MAP_PIXELS, MAP_PIXELS) for own in rests]
    return list(zip(discs, grids, squares, strict=True))


def basin_outlines(poses: RestPoses) -> list[tuple[Disc, list[list[Floats]]]]:
    """For each disc of the Gauss map, and each rest, polygons (m, 2) around its basin, in pixels of
    the map.

    A point of the disc is in the basin if it is within an odd number of them. Beyond the rim the
    polygons have no meaning.
    """
    centers = (2.0 * np.arange(-1, MAP_PIXELS + 1) + 1.0) / MAP_PIXELS - 1.0
    outlines = []
    for disc, _, rests in map_basins(poses):
        padded = np.pad(rests, 1, constant_values=-1)
        masks = [np.where(padded == rest, 1.0, 0.0) for rest in range(len(poses.facets))]
        rings = [
            contour_generator(centers, centers, mask).lines(0.5) if mask.any() else []
            for mask in masks
        ]
        outlines.append(
            (disc, [[disc.to_paper(np.asarray(ring)) for ring in own] for own in rings])
        )
    return outlines
