"""Resting probabilities from sampled start directions, and sets of directions."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.tracing import slide, trace_to_rests
from dicedesign.runtime.arrays import Floats

MOST_AT_ONCE = 20_000

MOST_HEIGHTS = 10_000_000
"""Limit on the heights of corners in memory, 80 MB."""

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def sampled_probabilities(
    equilibria: Equilibria, directions: Floats, most_at_once: int = MOST_AT_ONCE
) -> Floats:
    """Share of a set of directions from which a body comes to rest on each facet.

    The lowest corner is the lowest of all corners. Paths that rounding could change are followed as
    rounded; these start within rounding of the border of a basin.

    equilibria: the classified hull; directions: (n, 3) unit start directions that point down;
    most_at_once: number of directions that are traced together.
    Returns (m,), 0 for facets that are no rests. Source: algorithm 1.
    """
    facets = len(equilibria.hull.normals)
    at_once = min(most_at_once, max(1, MOST_HEIGHTS // len(equilibria.radii)))
    reached = np.zeros(facets, dtype=np.int64)
    for first in range(0, len(directions), at_once):
        down = directions[first : first + at_once]
        lowest = np.argmax(down @ equilibria.radii.T, axis=1)
        touched, _ = slide(equilibria, lowest, down, np.zeros(len(down)))
        reached += np.bincount(touched, minlength=facets)
    start = np.flatnonzero(reached)
    ends = trace_to_rests(equilibria, start)
    return np.bincount(ends, weights=reached[start], minlength=facets) / len(directions)


def random_directions(count: int, seed: int) -> Floats:
    """(count, 3) independent unit vectors, uniform on the sphere."""
    return unit_vectors(np.random.default_rng(seed).normal(size=(count, 3)))


def lattice_directions(count: int, seed: int) -> Floats:
    """(count, 3) unit vectors on a spherical Fibonacci lattice, in a random orientation.

    Each point stands for a zone of equal area, and successive ones are a golden angle apart. Unlike
    Sobol points it is as even for any number of points, and it has no seam where a square was
    wrapped around the sphere. The rotation keeps its axis off a body's axes of symmetry.
    Source: R. Swinbank and R. J. Purser, Q. J. R. Meteorol. Soc. 132 (2006) 1769-1793.
    """
    place = np.arange(count)
    z = 1.0 - (2.0 * place + 1.0) / count
    radius, angle = np.sqrt(1.0 - z * z), GOLDEN_ANGLE * place
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    return points @ Rotation.random(random_state=seed).as_matrix().T
