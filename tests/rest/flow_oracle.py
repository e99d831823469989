"""An independent answer: sampled bodies that roll by small explicit steps.

Particles on the sphere follow the gradient of the height U(d) = max_j r_j . d and nothing else:
no edges, facets, saddles or exact crossings. Across a ridge of U the steps zigzag, and their mean
is the motion along the ridge (explicit Euler for the differential inclusion, of first order).
"""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

__all__ = ["flow_frequencies"]


def flow_frequencies(
    vertices: np.ndarray,
    center: np.ndarray,
    normals: np.ndarray,
    count: int,
    step: float,
    seed: int,
) -> tuple[np.ndarray, int]:
    """How often sampled rolls end beside each of the rest directions.

    vertices: (n, 3); center: (3,); normals: (k, 3) rest directions, used only to name where a
    particle has ended; count: number of particles, a power of two; step: largest arc in radians
    of one step.
    Returns (k,) frequencies, and how many particles ended beside none of the directions.
    """
    radii = vertices - center
    radii = radii / np.sqrt((radii**2).sum(-1)).max()
    down = _directions(count, seed)
    ended = down.copy()
    active = np.arange(count)
    # Arcs are at most pi long, but zigzags and saddles take time: go on until none moves.
    for _ in range(60):
        before = down
        for _ in range(300):
            down = _moved(down, radii, step)
        ended[active] = down
        going = ((down - before) ** 2).sum(-1) > (0.5 * step) ** 2
        active, down = active[going], down[going]
        if len(active) == 0:
            break
    for _ in range(12):  # smaller and smaller zigzags about the end
        step /= 2
        for _ in range(20):
            ended = _moved(ended, radii, step)
    cosines = ended @ normals.T
    nearest = cosines.argmax(axis=1)
    lost = cosines.max(axis=1) < np.cos(0.01)
    counts = np.bincount(nearest[~lost], minlength=len(normals))
    return counts / count, int(lost.sum())


def _directions(count: int, seed: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the sphere (Sobol points, equal-area map)."""
    u, v = qmc.Sobol(2, rng=np.random.default_rng(seed)).random(count).T
    z, angle = 2 * u - 1, 2 * np.pi * v
    radius = np.sqrt(1 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def _moved(down: np.ndarray, radii: np.ndarray, step: float) -> np.ndarray:
    lowest = radii[np.argmax(down @ radii.T, axis=1)]
    slope = lowest - (lowest * down).sum(-1)[:, None] * down
    down = down - step * slope
    return down / np.sqrt((down * down).sum(-1))[:, None]
