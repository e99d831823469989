"""Body with many maxima and long separatrices."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull


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
