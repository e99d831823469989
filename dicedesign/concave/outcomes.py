"""Which rests of a surface's hull may become the outcomes, the likeliest choice first."""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.concave.slopes import climbs
from dicedesign.errors import InputError
from dicedesign.geometry.hull import ConvexHull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.rest.poses import RestPoses, analyse

__all__ = ["outcome_choices"]

Floats = NDArray[np.float64]

MOST_RESTS: Final = 7
"""Rests that are chosen from, the most probable ones, or two more than there are outcomes."""

APART: Final = np.cos(np.radians(20.0))
"""Cosine between two outcomes of one choice, at most: nearer ones are hard to tell apart."""

CLIMB_COST: Final = 3.0
"""Cost of the mean climb from all rests to the chosen ones, over the circumscribed radius."""

MISS_COST: Final = 0.3
"""Cost of the largest |p - q| of the clusters."""


def outcome_choices(hull: ConvexHull, target: Floats) -> list[Floats]:
    """Choices of (k, 3) unit directions for the outcomes of a target (k,).

    hull: about the center of mass at the origin, of circumscribed radius about 1. Where it has few
    rests, directions far from them make up for it.

    Raises InputError where a hull of that many corners has fewer facets than there are outcomes.
    """
    count = len(target)
    most = 2 * len(hull.vertices) - 4
    if count > most:
        raise InputError(
            f"target: expected at most {most} outcomes for a hull of {len(hull.vertices)} corners, "
            f"got {count}; join some, or refine the surface with method.concave.points"
        )
    poses = analyse(hull, np.zeros(3), "given")
    pool = _pool(poses, max(MOST_RESTS, count + 2))
    climb = climbs(hull.vertices, poses.normals, pool)
    order = np.argsort(target)
    costs, choices = [], []
    for chosen in combinations(range(len(pool)), count):
        directions = pool[list(chosen)]
        cosines = directions @ directions.T - 2.0 * np.eye(count)
        if cosines.max() > APART:
            continue
        own = climb[:, chosen]
        odds = np.bincount(own.argmin(axis=1), poses.probabilities, minlength=count)
        ranked = np.empty(count, dtype=np.int64)
        ranked[order] = np.argsort(odds, kind="stable")
        miss = float(np.abs(odds[ranked] - target).max())
        costs.append(MISS_COST * miss + CLIMB_COST * float(own.min(axis=1) @ poses.probabilities))
        choices.append(directions[ranked])
    return [choices[place] for place in np.argsort(costs, kind="stable")]


def _pool(poses: RestPoses, count: int) -> Floats:
    """(count, 3) directions: rests, the most probable first, then those far from all others."""
    pool = list(poses.normals[:count])
    normals = unit_vectors(poses.hull.normals)
    while len(pool) < count:
        pool.append(normals[np.argmin((normals @ np.array(pool).T).max(axis=1))])
    return np.array(pool)
