"""Two hemispheres of directions as equal-area discs of radius 1."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.runtime.arrays import Floats

__all__ = ["Disc", "choose_axis", "great_arcs", "opposite_discs"]


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
