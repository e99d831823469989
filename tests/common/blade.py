"""A body of many maxima, whose separatrices are long."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull


def blade(ball: int, edge: int) -> ConvexHull:
    """A ball of some points with a blade of others, along a quarter of a great circle about the
    origin. Each corner of the blade is a maximum; saddles between them can lie inside one basin."""
    points = np.random.default_rng(0).normal(size=(ball, 3))
    points *= 0.7 / np.linalg.norm(points, axis=1)[:, None]
    angle = np.radians(np.linspace(-45.0, 45.0, edge))
    arc = np.stack([np.sin(angle), np.zeros(edge), np.cos(angle)], axis=1)
    return convex_hull(np.concatenate([points + np.array([0.0, 0.0, 0.3]), arc]))
