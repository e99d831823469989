"""Random dice, each from its number alone: what the momentum model is fitted to and judged by.

Most are random polyhedra of several kinds, some of them with a center of mass beside the centroid.
The others are designed exactly for random odds, some of them with a symmetry: what somebody designs
has facets where random polyhedra seldom have them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import Final

import numpy as np

from benchmarks.training.random_polyhedra import KINDS, random_shape
from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.rigid_body import RigidBody, rigid_body

__all__ = ["DICE_KINDS", "RESTS", "RandomDie", "random_die"]

RESTS: Final = (3, 20)
"""Fewest and most rests of a random die."""

DESIGNED: Final = 0.25
"""Part of the dice that are designed."""

SYMMETRIC: Final = 0.4
"""Part of those that have a symmetry."""

OFF_CENTER: Final = 0.12
"""Part of the random polyhedra whose center of mass is not their centroid."""

OFFSETS: Final = (0.02, 0.1)
"""Range of how far it is from that, over the distance of the nearest corner."""

MOST_DESIGNED: Final = 13
"""Outcomes of a die that is designed, unless all dice are to have more."""

EVENNESS: Final = (1.5, 4.0, 12.0)
"""Parameters of the Dirichlet distributions that target odds are drawn from."""

LEAST_ODDS: Final = 0.012
"""Least target odds; smaller ones are raised to it."""

HIGHEST_ORDER: Final = 7
"""Of the main axis of a symmetric die."""

PAIRED_ODDS: Final = (0.3, 2.5)
"""Range of the odds of a symmetric die's other outcomes over those of the first."""

FACE_ON_AXIS: Final = 0.8
"""Part of the symmetric dice with a horizontal mirror that have outcomes on the axis."""

TURNS: Final = 12

STARTS: Final = 4
"""Turns of the search for starting shapes, and starts tried, before other odds are drawn."""

ACCURACY: Final = 1e-6
"""Largest deviation of a designed die's odds: far finer than thousands of throws tell."""

DICE_KINDS: Final = (*KINDS, "designed", "designed with symmetry")


@dataclass(frozen=True)
class RandomDie:
    """A random die, neither tied nor repaired.

    Attributes
    ----------
    kind: one of `DICE_KINDS`.
    poses: its rests. body: what is thrown, a uniform solid but for its center of mass.
    """

    kind: str
    poses: RestPoses
    body: RigidBody


def random_die(number: int, seed: int, rests: tuple[int, int] = RESTS) -> RandomDie:
    """The random die of a number.

    seed: of all dice; different ones give dice that have nothing in common. rests: fewest and most
    that it may have, within `RESTS`.
    """
    rng = np.random.default_rng([seed, number])
    designed = rng.random() < DESIGNED
    while True:
        try:
            drawn = _designed(rng, rests) if designed else _drawn(rng)
        except (DiceError, np.linalg.LinAlgError):
            continue
        if drawn is None:
            continue
        kind, points, poses = drawn
        tied = len(poses.basins) > 1 or poses.notes
        if rests[0] <= len(poses.facets) <= rests[1] and not tied:
            body = make_body(points, name=f"random die {number}")
            return RandomDie(kind, poses, rigid_body(body, poses))


def _drawn(rng: np.random.Generator) -> tuple[str, Floats, RestPoses]:
    """A random polyhedron: its kind, points and rests."""
    kind, points = random_shape(rng)
    if rng.random() >= OFF_CENTER:
        return kind, points, rest_poses(points, "hull")
    hull = convex_hull(points)
    aside = rng.normal(size=3)
    reach = np.linalg.norm(hull.vertices - hull.centroid, axis=1).min()
    offset = rng.uniform(*OFFSETS) * reach / np.linalg.norm(aside)
    return kind, points, rest_poses(points, hull.centroid + offset * aside)


def _designed(
    rng: np.random.Generator, rests: tuple[int, int]
) -> tuple[str, Floats, RestPoses] | None:
    """A die that was designed for random odds; None where no start led to them."""
    group: Floats | None = None
    if rng.random() < SYMMETRIC:
        kind = "designed with symmetry"
        target, name = _symmetric_odds(rng)
        group = point_group(name)
    else:
        kind = "designed"
        target = _odds(rng, rests)
    if not rests[0] <= len(target) <= rests[1]:
        return None
    seed = int(rng.integers(2**31))
    shapes = (
        shapes_near(target, seed) if group is None else symmetric_shapes_near(target, group, seed)
    )
    options = ExactOptions(tolerance=ACCURACY, starts=STARTS)
    result = solve_exactly(islice(shapes, TURNS), target, options, group=group)
    if result.status is not Status.CONVERGED:
        return None
    points = result.hull.vertices
    return kind, points, rest_poses(points, "hull")


def _odds(rng: np.random.Generator, rests: tuple[int, int]) -> Floats:
    """(k,) of any outcomes, k within limits."""
    least, most = rests
    outcomes = int(rng.integers(least, max(least, min(most, MOST_DESIGNED)) + 1))
    odds = rng.dirichlet(np.full(outcomes, rng.choice(EVENNESS)))
    return _normalised(np.maximum(odds, LEAST_ODDS))


def _symmetric_odds(rng: np.random.Generator) -> tuple[Floats, str]:
    """(k,) odds whose equal ones a point group may map onto each other, and the group's name."""
    order = int(rng.integers(2, HIGHEST_ORDER + 1))
    first, second = rng.uniform(*PAIRED_ODDS, size=2)
    around = np.ones(order)
    if rng.random() < 0.5:
        others = [first] if order > 2 else [second, second, first]
        return _normalised(np.concatenate([around, others])), f"C{order}v"
    if order == 2:
        odds = np.concatenate([around, [first, first, second, second]])
    elif rng.random() < FACE_ON_AXIS:
        odds = np.concatenate([around, [first, first]])
    else:
        odds = around
    return _normalised(odds), f"D{order}h"


def _normalised(odds: Floats) -> Floats:
    normalised: Floats = odds / odds.sum()
    return normalised
