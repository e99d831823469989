"""The Gauss map: two hemispheres of directions as equal-area discs, and the basins on them."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import even_directions, norms, unit_vectors
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.tracing import slide
from dicedesign.runtime.arrays import Floats, Integers

RIM_STEP: Final = math.radians(5.0)
"""Longest piece of an arc: straight on paper it is beside the arc by less than half a pixel."""

DISC_PIXELS: Final = 690.0
"""Of a disc's square, which is a little larger."""

MAP_SIZE: Final = (2.0 * DISC_PIXELS + 60.0, DISC_PIXELS + 195.0)
"""Pixels across and down of the figure of a Gauss map."""

RADIUS: Final = DISC_PIXELS / (2.0 * 1.02)
"""Of a disc, in pixels."""

LEAST_WRITTEN: Final = 0.01
"""Probability up to which a rest is not written on the map."""

CHUNK: Final = 20_000
"""Directions that are followed at a time."""


@dataclass(frozen=True, eq=False)
class Disc:
    """The hemisphere around an axis, seen from outside, by Lambert's azimuthal projection, in its
    place on the map.

    Areas on the disc are in proportion to areas on the sphere. The body's +z (or +y where the axis
    is z) is upward on paper.

    Attributes
    ----------
    short: the axis as short integers.
    middle: (2,) pixels of the center.
    """

    short: tuple[int, int, int]
    middle: Floats

    @property
    def frame(self) -> Floats:
        """(3, 3) unit directions of the paper's x and y, and of the center."""
        upward = np.array([0.0, 1.0, 0.0] if self.short[:2] == (0, 0) else [0.0, 0.0, 1.0])
        right = np.cross(upward, self.short)
        return unit_vectors(np.stack([right, np.cross(self.short, right), self.short]))

    def heights(self, directions: Floats) -> Floats:
        """(...) above 0 for unit directions (..., 3) on the disc, and below for others."""
        return np.asarray(directions @ self.frame[2])

    def project(self, directions: Floats) -> Floats:
        """Points (..., 2) of the disc of radius 1 of unit directions (..., 3); those that are not
        on the disc lie around it, but for the opposite of the axis."""
        flat = directions @ self.frame[:2].T
        return flat / np.sqrt(1.0 + self.heights(directions))[..., None]

    def to_paper(self, points: Floats) -> Floats:
        """Pixels (..., 2), the second downward, of points (..., 2) of the disc of radius 1."""
        return self.middle + RADIUS * points * [1.0, -1.0]

    def pixels(self, size: int) -> Floats:
        """Unit directions (size, size, 3) of the centers of a grid over [-1, 1]^2, lowest row
        first; centers off the disc stand for the nearest point of its rim."""
        centers = (2.0 * np.arange(size) + 1.0) / size - 1.0
        points = np.stack(np.meshgrid(centers, centers), axis=-1)
        points = points / np.maximum(norms(points), 1.0)[..., None]
        squared = (points * points).sum(-1)[..., None]
        flat = points * np.sqrt(2.0 - squared)
        return np.asarray(np.concatenate([flat, 1.0 - squared], axis=-1) @ self.frame)

    def unfold(self, directions: Floats, opened: Floats) -> Floats:
        """Points (n, 2) of unit directions (n, 3): those on the disc of radius 1 as projected,
        others outside of it, the farther the nearer they are to a direction opposite the disc."""
        frame = self.frame * [[1.0], [1.0], [-1.0]]
        local = np.vstack([directions, opened]) @ frame.T
        *flat, center = local[:, :2] / np.sqrt(1.0 + np.abs(local[:, 2:]))
        # On paper the other hemisphere is a disc too, and rays lead from that place to its rim.
        ray = np.array(flat) - center
        along, squared = ray @ center, (ray * ray).sum(-1)
        reach = np.sqrt(along**2 + squared * (1.0 - center @ center)) - along
        rim = center + ray * (reach / squared)[:, None]
        outside = rim * (10.0 - 9.0 * squared / reach)[:, None]
        return np.where(local[:-1, 2:] > 0.0, outside, flat)


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


def place_discs(poses: RestPoses) -> tuple[Disc, Disc]:
    """The two hemispheres of the figure of a body, where the figure has them."""
    weighty = poses.probabilities >= min(LEAST_WRITTEN, poses.probabilities[0])
    x, y, z = choose_axis(poses.normals[weighty])
    half, height = DISC_PIXELS / 2.0, 60.0 + DISC_PIXELS / 2.0
    return (
        Disc((x, y, z), np.array([15.0 + half, height])),
        Disc((-x, -y, -z), np.array([45.0 + 3.0 * half, height])),
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


def basin_outlines(poses: RestPoses) -> list[tuple[Disc, list[list[Floats]]]]:
    """For each disc of `gauss_map_figure` and each rest the closed polygons (m, 2) of its basin, in
    pixels of the map.

    What is on the disc and within an odd number of them is in the basin; outside of the disc they
    mean nothing.
    """
    borders = basin_borders(poses)
    points = np.concatenate([np.zeros((1, 3)), *(loop for loops in borders for loop in loops)])
    turns = np.linspace(0.0, 2.0 * np.pi, 5)[:-1]
    around = 30.0 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    outlines = []
    for disc in place_discs(poses):
        far = even_directions(1000)
        far = far[disc.heights(far) < -0.2]
        opened = far[(far @ points.T).max(axis=1).argmin()]
        at_opened = int(basin_of_directions(poses, opened[None])[0])
        rings = [[disc.unfold(loop, opened) for loop in loops] for loops in borders]
        rings[at_opened].append(around)
        outlines.append((disc, [[disc.to_paper(ring) for ring in own] for own in rings]))
    return outlines


def basin_borders(poses: RestPoses) -> list[list[Floats]]:
    """For each rest the borders of its basin: closed loops (m, 3) of unit directions in short
    steps, without the first repeated, the basin on their left."""
    maxima = poses.basins[0].paths.maxima.reshape(-1, 2).tolist()
    sides = poses.morse.saddle_basins.tolist()
    leaving: list[dict[int, list[tuple[int, Floats]]]] = [defaultdict(list) for _ in poses.facets]
    for path, (end, begin), (left, right) in zip(poses.morse.polylines, maxima, sides, strict=True):
        fine = _fine(path)
        leaving[left][begin].append((end, fine))
        leaving[right][end].append((begin, fine[::-1]))
    borders: list[list[Floats]] = [[] for _ in poses.facets]
    for rest, lines in enumerate(leaving):
        for first in list(lines):
            while lines[first]:
                point, parts = first, []
                while lines[point]:
                    point, path = lines[point].pop()
                    parts.append(path[:-1])
                borders[rest].append(np.concatenate(parts))
    return borders


def _fine(path: Floats) -> Floats:
    """A path (n, 3) of great arcs with points between, so that none is longer than a step."""
    longest = float(norms(np.diff(path, axis=0)).max(initial=0.0))
    arcs = great_arcs(path[:-1], path[1:], math.ceil(longest / RIM_STEP) or 1)
    return np.concatenate([arcs[:, :-1].reshape(-1, 3), path[-1:]])
