"""Random dice, each from its number alone: what the momentum model is fitted to and judged by.

Most are random polyhedra of several kinds, some of them with a center of mass beside the centroid.
The others are designed exactly for random odds, some of them with a symmetry: what somebody designs
has facets where random polyhedra seldom have them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice, product
from typing import Final

import numpy as np

from dicedesign.errors import DegenerateBodyError, DiceError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.starts.half_space_odds import spread_directions
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.symmetric_search import symmetric_shapes_near
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.rigid_body import RigidBody, rigid_body

FACETS: Final = (5, 20)
"""Fewest and most half-spaces of a pebble; they need not all make facets."""

CORNERS: Final = (5, 12)
"""Fewest and most points of a hull of points; they need not all be corners."""

MOST_SPREADING: Final = 60
"""Steps in which random directions repel each other are fewer than this."""

FEWEST_STEPS: Final = 5
"""Of them for half-spaces, which may bound nothing where they face the same way."""

UNEVENNESS: Final = (0.02, 0.25)
"""Half the range of the distances of half-spaces around 1."""

POINT_DISTANCES: Final = (0.75, 1.25)
"""Range of the distances of a hull's points."""

WIDTHS: Final = (0.7, 1.0)

SHORT: Final = (0.45, 0.8)

LONG: Final = (1.2, 2.0)
"""Ranges of a stretched pebble's second extent over its first, and of its third if it is flat, and
if it is long."""

PRISM_SIDES: Final = (3, 12)

PYRAMID_SIDES: Final = (3, 10)

HEIGHTS: Final = (0.4, 2.0)
"""Of a prism's half and of a bipyramid's upper pyramid, over the circumscribed radius."""

TAPERS: Final = (0.6, 1.0)
"""Range of the size of a prism's top over its bottom's."""

MOST_TWIST: Final = 0.3
"""Of every other prism's top against its bottom, in radians."""

LOWER_HEIGHTS: Final = (0.5, 1.0)
"""Range of the height of a bipyramid's lower pyramid over its upper one's."""

TURN_ANGLES: Final = (0.02, 0.06)
"""Angles in radians by which facets of regular shapes are turned: one of the two for a shape."""

SHIFTS: Final = (0.9, 1.1)
"""Range of the factors by which they are shifted."""

BOX_EXTENTS: Final = (0.5, 1.0)

BOX_NOISE: Final = 0.05
"""Standard deviation of the coordinates of a box's corners, over half its largest extent."""

PLATONIC_NOISE: Final = 0.12
"""Of those of a Platonic solid's, over its circumscribed radius."""

GOLDEN: Final = (1.0 + 5.0**0.5) / 2.0

SIGNS: Final = np.array(list(product((-1.0, 1.0), repeat=3)))

PLATONIC: Final = (
    np.array([(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)]),
    SIGNS,
    np.concatenate([np.eye(3), -np.eye(3)]),
    np.unique(
        np.concatenate([np.roll(SIGNS * (0.0, 1.0, GOLDEN), turn, axis=1) for turn in range(3)])
        + 0.0,
        axis=0,
    ),
)
"""Corners of tetrahedron, cube, octahedron and icosahedron."""


def random_shape(rng: np.random.Generator) -> tuple[str, Floats]:
    """A kind of `KINDS`, and points (n, 3) in no unit whose hull is a polyhedron of it that has the
    origin inside or near.

    Raises DegenerateBodyError: what was drawn bounds no solid.
    """
    names = tuple(KINDS)
    parts = np.array([part for part, _ in KINDS.values()])
    kind = names[rng.choice(len(names), p=parts / parts.sum())]
    return kind, KINDS[kind][1](rng)


def _pebble(rng: np.random.Generator) -> Floats:
    """Half-spaces facing all ways at distances around 1."""
    facets = _whole(rng, FACETS)
    steps = int(rng.integers(FEWEST_STEPS, MOST_SPREADING))
    unevenness = rng.uniform(*UNEVENNESS)
    distances = rng.uniform(1.0 - unevenness, 1.0 + unevenness, facets)
    return polyhedron_corners(spread_directions(facets, rng, steps), distances)


def _stretched(rng: np.random.Generator) -> Floats:
    third = rng.uniform(*(SHORT if rng.random() < 0.5 else LONG))
    return _pebble(rng) * np.array([1.0, rng.uniform(*WIDTHS), third])


def _hull(rng: np.random.Generator) -> Floats:
    points = _whole(rng, CORNERS)
    directions = spread_directions(points, rng, int(rng.integers(0, MOST_SPREADING)))
    return directions * rng.uniform(*POINT_DISTANCES, (points, 1))


def _prism(rng: np.random.Generator) -> Floats:
    """Over a regular polygon, tapered and perhaps twisted, with its facets moved."""
    sides, height = _whole(rng, PRISM_SIDES), rng.uniform(*HEIGHTS)
    twist = rng.uniform(0.0, MOST_TWIST) if rng.random() < 0.5 else 0.0
    bottom, top = _ring(sides, 0.0), rng.uniform(*TAPERS) * _ring(sides, twist)
    axis = np.array([0.0, 0.0, height])
    return _moved(np.concatenate([bottom - axis, top + axis]), rng)


def _bipyramid(rng: np.random.Generator) -> Floats:
    sides, height = _whole(rng, PYRAMID_SIDES), rng.uniform(*HEIGHTS)
    lower = -height * rng.uniform(*LOWER_HEIGHTS)
    apexes = np.array([(0.0, 0.0, height), (0.0, 0.0, lower)])
    return _moved(np.concatenate([_ring(sides, 0.0), apexes]), rng)


def _box(rng: np.random.Generator) -> Floats:
    """With its corners moved, so that its sides are creased."""
    return SIGNS * rng.uniform(*BOX_EXTENTS, 3) + BOX_NOISE * rng.normal(size=SIGNS.shape)


def _platonic(rng: np.random.Generator) -> Floats:
    """With either its facets or its corners moved."""
    corners = PLATONIC[rng.integers(len(PLATONIC))]
    corners = corners / np.linalg.norm(corners[0])
    if rng.random() < 0.5:
        return _moved(corners, rng)
    return corners + PLATONIC_NOISE * rng.normal(size=corners.shape)


def _ring(sides: int, turn: float) -> Floats:
    """(sides, 3) corners of a regular polygon in the plane z = 0, turned by an angle."""
    angles = 2.0 * np.pi * np.arange(sides) / sides + turn
    return np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)


def _moved(corners: Floats, rng: np.random.Generator) -> Floats:
    """Corners of the hull of points (n, 3) after its facets have been turned and shifted."""
    hull = convex_hull(corners)
    normals = hull.normals + rng.choice(TURN_ANGLES) * rng.normal(size=hull.normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = hull.heights(np.zeros(3)) * rng.uniform(*SHIFTS, len(normals))
    if offsets.min() <= 0.0:
        raise DegenerateBodyError(
            "random shape: expected the origin inside, got it on the other side of a facet; draw "
            "again"
        )
    return polyhedron_corners(normals, offsets)


def _whole(rng: np.random.Generator, limits: tuple[int, int]) -> int:
    """A random whole number within limits, both included."""
    return int(rng.integers(limits[0], limits[1] + 1))


KINDS: Final[dict[str, tuple[float, Callable[[np.random.Generator], Floats]]]] = {
    "pebble": (0.4, _pebble),
    "stretched pebble": (0.1, _stretched),
    "hull of points": (0.12, _hull),
    "prism": (0.14, _prism),
    "bipyramid": (0.1, _bipyramid),
    "box": (0.06, _box),
    "Platonic solid": (0.08, _platonic),
}
"""Part of the shapes that is of each kind, and what draws one."""


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
