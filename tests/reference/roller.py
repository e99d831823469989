"""Independent probabilities: sampled bodies roll over their points, without a hull.

The height of the center of mass above the table, of which r_i are the points seen from there, is
max_i r_i . d for the direction d that points down. It falls fastest along the shortest vector in
the convex hull of the tangential parts of the points that touch the table: a great circle, until
another point touches. A body comes to rest where this vector is 0.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.stats import qmc

__all__ = ["come_to_rest", "roll_frequencies"]

TOUCHES = 1e-12
"""Height up to which a point touches the table, relative to the farthest point."""


def come_to_rest(radii: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Direction (3,) that points down at last, for points (n, 3) relative to the center of mass and
    a unit direction (3,) that does so at first."""
    radii = radii / np.sqrt((radii**2).sum(-1)).max()
    heights = radii @ down
    touching = set(np.flatnonzero(heights >= heights.max() - TOUCHES).tolist())
    while True:
        rows = np.array(sorted(touching))
        tangents = radii[rows] - (radii[rows] @ down)[:, None] * down
        slope, kept = _shortest(tangents)
        steepness = np.sqrt(slope @ slope)
        if steepness <= TOUCHES:
            return down
        along = -slope / steepness
        first = radii[rows[kept[0]]]
        rises = (radii - first) @ along
        rises[rows] = 0.0
        waits = np.full(len(radii), np.inf)
        ahead = rises > 0.0
        waits[ahead] = np.arctan2(np.maximum((first - radii[ahead]) @ down, 0.0), rises[ahead])
        turn = waits.min()
        assert turn < np.pi
        touching = set(rows[kept].tolist()) | set(np.flatnonzero(waits <= turn + TOUCHES).tolist())
        down = np.cos(turn) * down + np.sin(turn) * along
        down = down / np.sqrt(down @ down)


def _shortest(vectors: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Shortest vector in the convex hull of vectors (k, 3) in a plane, and those that it is a
    mixture of; 0 where none of them or of their pairs have it."""
    candidates = [(v, [i]) for i, v in enumerate(vectors)]
    for i, j in combinations(range(len(vectors)), 2):
        across = vectors[j] - vectors[i]
        share = -(vectors[i] @ across) / (across @ across)
        if 0.0 < share < 1.0:
            candidates.append((vectors[i] + share * across, [i, j]))
    candidates.sort(key=lambda each: float(each[0] @ each[0]))
    for vector, kept in candidates:
        if (vectors @ vector >= vector @ vector - TOUCHES * np.sqrt(vector @ vector)).all():
            return vector, kept
    return np.zeros(3), []


def roll_frequencies(
    points: np.ndarray, center: np.ndarray, normals: np.ndarray, count: int, seed: int
) -> tuple[np.ndarray, int]:
    """Frequencies (k,) of the rests with normals (k, 3) in rolls of a body of points (n, 3) with a
    center of mass (3,), and the number of rolls that ended at none of them.

    count: rolls, a power of two, from directions spread evenly over the sphere.
    """
    u, v = qmc.Sobol(2, rng=np.random.default_rng(seed)).random(count).T
    z, angle = 2.0 * u - 1.0, 2.0 * np.pi * v
    radius = np.sqrt(1.0 - z * z)
    starts = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    ends = np.array([come_to_rest(points - center, down) for down in starts])
    distances = np.sqrt(((ends[:, None] - normals) ** 2).sum(-1))
    lost = distances.min(axis=1) > 1e-3
    found = distances.argmin(axis=1)[~lost]
    return np.bincount(found, minlength=len(normals)) / count, int(lost.sum())
