"""Parts of random models beside those of the shapes, as distance functions, and what is done to
them.

Each maps points (..., 3) to values (...) that are below 0 inside and near the surface about the
distance from it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from dicedesign.concave.distance_functions import Distance, Vector, blend
from dicedesign.runtime.arrays import Floats

__all__ = [
    "blended",
    "closed_tube",
    "ring",
    "rippled",
    "rounded_box",
    "swept",
    "turned",
    "without",
]


def ring(radius: float, thickness: float) -> Distance:
    """A torus about the z axis.

    radius: of the circle in its middle; thickness: radius of the tube about it.
    """

    def distance(points: Floats) -> Floats:
        x, y, z = np.moveaxis(points, -1, 0)
        away: Floats = np.hypot(np.hypot(x, y) - radius, z) - thickness
        return away

    return distance


def swept(part: Distance) -> Distance:
    """What a part sweeps that is turned once about the z axis, as far as it lies at y = 0 and x at
    least 0."""

    def distance(points: Floats) -> Floats:
        x, y, z = np.moveaxis(points, -1, 0)
        return part(np.stack([np.hypot(x, y), np.zeros_like(z), z], axis=-1))

    return distance


def rounded_box(center: Vector, half_sides: Vector, rounding: float) -> Distance:
    """A box along the axes whose edges are rounded by this radius, less than every half side."""
    core = np.array(half_sides) - rounding

    def distance(points: Floats) -> Floats:
        beyond = np.abs(points - np.array(center)) - core
        inside = beyond.max(axis=-1).clip(max=0.0)
        outside = np.sqrt((beyond.clip(0.0) ** 2).sum(axis=-1))
        value: Floats = outside + inside - rounding
        return value

    return distance


def closed_tube(line: Floats, radius: float) -> Distance:
    """All within a radius of points (n, 3) that follow each other closely along a closed line."""
    tree = cKDTree(line)

    def distance(points: Floats) -> Floats:
        away: Floats = tree.query(points)[0] - radius
        return away

    return distance


def turned(part: Distance, rotation: Floats, center: Vector = (0.0, 0.0, 0.0)) -> Distance:
    """A part about the origin, turned by a matrix (3, 3) and moved to a center."""

    def distance(points: Floats) -> Floats:
        return part(np.einsum("...i,ij->...j", points - np.array(center), rotation))

    return distance


def without(body: Distance, part: Distance) -> Distance:
    """A body from which a part is cut."""

    def distance(points: Floats) -> Floats:
        value: Floats = np.maximum(body(points), -part(points))
        return value

    return distance


def rippled(part: Distance, waves: Floats, phases: Floats, height: float) -> Distance:
    """A part whose surface goes up and down by a height, by the mean of waves.

    waves: (w, 3) wave vectors, in radians for a unit of length; phases: (w,) in radians.
    """

    def distance(points: Floats) -> Floats:
        turns = np.einsum("...i,wi->...w", points, waves) + phases
        value: Floats = part(points) + height * np.sin(turns).mean(axis=-1)
        return value

    return distance


def blended(parts: Sequence[Distance], width: float) -> Distance:
    """All parts joined in turn, creases rounded by blends of this width."""
    first, *others = parts
    for part in others:
        first = blend(first, part, width)
    return first
