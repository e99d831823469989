"""Independent probabilities: sampled bodies roll in small explicit steps.

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
    """Frequencies of the rests of sampled rolls.

    vertices: (n, 3); center: (3,); normals: (k, 3) rest directions, used only to name the end of a
    particle; count: number of particles, a power of two; step: largest arc in radians
    of one step.
    Returns (k,) frequencies, and the number of particles that ended at no rest direction.
    """
    radii = vertices - center
    radii = radii / np.sqrt((radii**2).sum(-1)).max()
    down = _directions(count, seed)
    for fraction in (1.0, 0.25, 0.0625):  # smaller steps free particles from wide zigzags
        _roll_until_stuck(down, radii, fraction * step)
    cosines = down @ normals.T
    nearest = cosines.argmax(axis=1)
    lost = cosines.max(axis=1) < np.cos(0.01)
    counts = np.bincount(nearest[~lost], minlength=len(normals))
    return counts / count, int(lost.sum())


def _roll_until_stuck(down: np.ndarray, radii: np.ndarray, step: float) -> None:
    """Move particles `down` (n, 3) in place until none leaves its zigzag."""
    active = np.arange(len(down))
    for _ in range(60):
        moved = down[active]
        for _ in range(300):
            moved = _step(moved, radii, step)
        going = ((moved - down[active]) ** 2).sum(-1) > step**2
        down[active] = moved
        active = active[going]
        if len(active) == 0:
            return


def _directions(count: int, seed: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the sphere (Sobol points, equal-area map)."""
    u, v = qmc.Sobol(2, rng=np.random.default_rng(seed)).random(count).T
    z, angle = 2 * u - 1, 2 * np.pi * v
    radius = np.sqrt(1 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def _step(down: np.ndarray, radii: np.ndarray, step: float) -> np.ndarray:
    lowest = radii[np.argmax(down @ radii.T, axis=1)]
    slope = lowest - (lowest * down).sum(-1)[:, None] * down
    down = down - step * slope
    return down / np.sqrt((down * down).sum(-1))[:, None]
