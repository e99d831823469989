"""Boxes and blades, and mesh files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dicedesign.fabricate.file_formats import mesh_bytes
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers


def write_mesh(path: Path, points: Floats, triangles: Integers) -> None:
    """Write a closed mesh in the format of the path's ending."""
    path.write_bytes(mesh_bytes(points, triangles, path.suffix))


CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def box(sizes: Sequence[float], lean: Sequence[float] = (0.0, 0.0, 0.0)) -> Surface:
    """Box with a corner at the origin. sizes: (3,); lean: (3,) shift of the top."""
    points = CORNERS * sizes + CORNERS[:, 2:] * np.array(lean)
    hull = convex_hull(points)
    return hull.surface


def blade(ball: int, edge: int) -> ConvexHull:
    """Random ball with a blade: points on a quarter of a great circle around the origin.

    ball, edge: numbers of points. Each corner of the blade is a maximum. Saddles between them can
    lie inside one basin.
    """
    points = np.random.default_rng(0).normal(size=(ball, 3))
    points *= 0.7 / np.linalg.norm(points, axis=1)[:, None]
    angle = np.radians(np.linspace(-45.0, 45.0, edge))
    arc = np.stack([np.sin(angle), np.zeros(edge), np.cos(angle)], axis=1)
    return convex_hull(np.concatenate([points + np.array([0.0, 0.0, 0.3]), arc]))
