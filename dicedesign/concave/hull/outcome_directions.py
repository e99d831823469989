"""Choices of rests of a surface's hull that may become the outcomes, the likeliest first."""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np

from dicedesign.concave.hull.slopes import climbs
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.rest.poses import RestPoses, analyse
from dicedesign.runtime.arrays import Floats

__all__ = ["drawn_choice", "outcome_choices"]

MOST_RESTS: Final = 7
"""Rests that are chosen from, the most probable ones, or two more than there are outcomes."""

APART: Final = np.cos(np.radians(20.0))
"""Cosine between two outcomes of one choice, at most: nearer ones are hard to tell apart."""

CLIMB_COST: Final = 3.0
"""Cost of the mean climb from all rests to the chosen ones, over the circumscribed radius."""

CHOICE_SCALE: Final = 1.0
"""Mean place, among the choices, of the one that is drawn."""

MISS_COST: Final = 0.3
"""Cost of the largest |p - q| of the clusters."""


def drawn_choice(choices: list[Floats], random: np.random.Generator) -> Floats:
    """One of the choices (k, 3), at random, the likelier the earlier it comes."""
    return choices[int(random.exponential(CHOICE_SCALE)) % len(choices)]


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
    several = max(MOST_RESTS, count + 2)
    pool = _filled_up(poses.normals[:several], several, poses)
    places = _far_apart(pool, count)
    if not places:
        pool = _filled_up(_distinct(poses.normals)[:count], count, poses)
        places = [list(range(count))]
    climb = climbs(hull.vertices, poses.normals, pool)
    order = np.argsort(target)
    costs, choices = [], []
    for chosen in places:
        own = climb[:, chosen]
        odds = np.bincount(own.argmin(axis=1), poses.probabilities, minlength=count)
        ranked = np.empty(count, dtype=np.int64)
        ranked[order] = np.argsort(odds, kind="stable")
        miss = float(np.abs(odds[ranked] - target).max())
        costs.append(MISS_COST * miss + CLIMB_COST * float(own.min(axis=1) @ poses.probabilities))
        choices.append(pool[chosen][ranked])
    return [choices[place] for place in np.argsort(costs, kind="stable")]


def _far_apart(pool: Floats, count: int) -> list[list[int]]:
    """The sets of so many directions of a pool that are all apart."""
    near = np.argwhere(np.triu(pool @ pool.T > APART, 1)).tolist()
    sets = (list(chosen) for chosen in combinations(range(len(pool)), count))
    return [chosen for chosen in sets if not any(a in chosen and b in chosen for a, b in near)]


def _distinct(normals: Floats) -> Floats:
    """(m, 3) those that are apart from all before them."""
    kept: list[int] = []
    for number, normal in enumerate(normals):
        if (normals[kept] @ normal).max(initial=-1.0) <= APART:
            kept.append(number)
    return normals[kept]


def _filled_up(directions: Floats, count: int, poses: RestPoses) -> Floats:
    """(count, 3) the directions, and those of facets that are far from all others, and of corners
    where the facets are too few."""
    candidates = poses.hull.normals
    if len(candidates) < count:
        candidates = np.concatenate([candidates, unit_vectors(poses.hull.vertices)])
    while len(directions) < count:
        farthest = np.argmin((candidates @ directions.T).max(axis=1))
        directions = np.vstack([directions, candidates[farthest]])
    return directions
