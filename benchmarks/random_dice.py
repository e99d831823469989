"""Random dice and their simulated throws: what the momentum model is fitted to and judged by.

Most are random polyhedra of several kinds, some of them with a center of mass beside the centroid.
The others are designed exactly for random probabilities, some of them with a symmetry: what
    somebody designs
has facets where random polyhedra seldom have them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import torch

from dicedesign import DiceError, Table, make_body, rest_poses, rigid_body, simulate
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.optimize.starts.shapes import spread_directions
from dicedesign.rest.poses import RestPoses
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.distances import noise_floor, total_variation
from dicedesign.throws.momentum_model import MomentumMixture
from dicedesign.throws.momentum_probabilities import momentum_probabilities
from dicedesign.throws.rigid_body import RigidBody

GOLDEN = (1.0 + 5.0**0.5) / 2.0

SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))

PLATONIC = (
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


def _pebble(rng: np.random.Generator) -> Floats:
    """Half-spaces facing all ways, up to 20 of them, at distances around 1."""
    facets = int(rng.integers(5, 21))
    # Directions that have hardly repelled each other may bound nothing.
    steps = int(rng.integers(5, 60))
    unevenness = rng.uniform(0.02, 0.25)
    distances = rng.uniform(1.0 - unevenness, 1.0 + unevenness, facets)
    return polyhedron_corners(spread_directions(facets, rng, steps), distances)


def _stretch_pebble(rng: np.random.Generator) -> Floats:
    """A pebble made flat or long."""
    third = rng.uniform(*((0.45, 0.8) if rng.random() < 0.5 else (1.2, 2.0)))
    return _pebble(rng) * np.array([1.0, rng.uniform(0.7, 1.0), third])


def _hull(rng: np.random.Generator) -> Floats:
    """Up to 12 points, which need not all be corners."""
    points = int(rng.integers(5, 13))
    directions = spread_directions(points, rng, int(rng.integers(0, 60)))
    return directions * rng.uniform(0.75, 1.25, (points, 1))


def _prism(rng: np.random.Generator) -> Floats:
    """Over a regular polygon, tapered and perhaps twisted by 0.3 at most, with its facets moved."""
    sides, height = int(rng.integers(3, 13)), rng.uniform(0.4, 2.0)
    twist = rng.uniform(0.0, 0.3) if rng.random() < 0.5 else 0.0
    bottom, top = _ring(sides, 0.0), rng.uniform(0.6, 1.0) * _ring(sides, twist)
    axis = np.array([0.0, 0.0, height])
    return _perturb_corners(np.concatenate([bottom - axis, top + axis]), rng)


def _bipyramid(rng: np.random.Generator) -> Floats:
    """Two pyramids, the lower one no higher than the other, with its facets moved."""
    sides, height = int(rng.integers(3, 11)), rng.uniform(0.4, 2.0)
    apexes = np.array([(0.0, 0.0, height), (0.0, 0.0, -height * rng.uniform(0.5, 1.0))])
    return _perturb_corners(np.concatenate([_ring(sides, 0.0), apexes]), rng)


def _box(rng: np.random.Generator) -> Floats:
    """With its corners moved, so that its sides are creased."""
    return SIGNS * rng.uniform(0.5, 1.0, 3) + 0.05 * rng.normal(size=SIGNS.shape)


def _platonic(rng: np.random.Generator) -> Floats:
    """With either its facets or its corners moved."""
    corners = PLATONIC[rng.integers(len(PLATONIC))]
    corners = corners / np.linalg.norm(corners[0])
    if rng.random() < 0.5:
        return _perturb_corners(corners, rng)
    return corners + 0.12 * rng.normal(size=corners.shape)


def _ring(sides: int, turn: float) -> Floats:
    """(sides, 3) corners of a regular polygon in the plane z = 0, turned by an angle."""
    angles = 2.0 * np.pi * np.arange(sides) / sides + turn
    return np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)


def _perturb_corners(corners: Floats, rng: np.random.Generator) -> Floats:
    """Corners of the hull of points (n, 3) after its facets have been turned, all by little or all
    by more, and shifted by up to a tenth."""
    hull = convex_hull(corners)
    normals = hull.normals + rng.choice((0.02, 0.06)) * rng.normal(size=hull.normals.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = hull.heights(np.zeros(3)) * rng.uniform(0.9, 1.1, len(normals))
    if offsets.min() <= 0.0:
        raise DiceError("random shape: the origin is on the other side of a facet; draw again")
    return polyhedron_corners(normals, offsets)


KINDS = {
    "pebble": (0.4, _pebble),
    "stretched pebble": (0.1, _stretch_pebble),
    "hull of points": (0.12, _hull),
    "prism": (0.14, _prism),
    "bipyramid": (0.1, _bipyramid),
    "box": (0.06, _box),
    "Platonic solid": (0.08, _platonic),
}
"""Part of the shapes that is of each kind, and what draws one: points in no unit, the origin inside
or near."""

RESTS = (3, 20)
"""Fewest and most rests of a random die."""

DICE_KINDS = (*KINDS, "designed", "designed with symmetry")


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
    """The random die of a number; a quarter of them are designed.

    seed: of all dice; different ones give dice that have nothing in common. rests: fewest and most
    that it may have, within `RESTS`.
    """
    rng = np.random.default_rng([seed, number])
    draw = _design_die if rng.random() < 0.25 else _draw_polyhedron
    while True:
        try:
            drawn = draw(rng, rests)
        except (DiceError, np.linalg.LinAlgError):
            continue
        if drawn is None:
            continue
        kind, points, poses = drawn
        tied = len(poses.basins) > 1 or poses.notes
        if rests[0] <= len(poses.facets) <= rests[1] and not tied:
            body = make_body(points, name=f"random die {number}")
            return RandomDie(kind, poses, rigid_body(body, poses))


def _draw_polyhedron(
    rng: np.random.Generator, rests: tuple[int, int]
) -> tuple[str, Floats, RestPoses]:
    """A random polyhedron: its kind, points and rests. One in eight has its center of mass beside
    the centroid, by a tenth of the distance to the nearest corner at most."""
    parts = np.array([part for part, _ in KINDS.values()])
    kind = tuple(KINDS)[rng.choice(len(KINDS), p=parts / parts.sum())]
    points = KINDS[kind][1](rng)
    if rng.random() >= 0.12:
        return kind, points, rest_poses(points, "hull")
    hull = convex_hull(points)
    aside = rng.normal(size=3)
    reach = np.linalg.norm(hull.vertices - hull.centroid, axis=1).min()
    offset = rng.uniform(0.02, 0.1) * reach / np.linalg.norm(aside)
    return kind, points, rest_poses(points, hull.centroid + offset * aside)


def _design_die(
    rng: np.random.Generator, rests: tuple[int, int]
) -> tuple[str, Floats, RestPoses] | None:
    """A die that was designed for random probabilities, two in five with a symmetry; None where no
    start led to them."""
    group: Floats | None = None
    if rng.random() < 0.4:
        kind = "designed with symmetry"
        target, name = _symmetric_probabilities(rng)
        group = point_group(name)
    else:
        kind = "designed"
        # Up to 13 outcomes, unless all dice are to have more.
        outcomes = int(rng.integers(rests[0], max(rests[0], min(rests[1], 13)) + 1))
        target = rng.dirichlet(np.full(outcomes, rng.choice((1.5, 4.0, 12.0)))).clip(0.012)
        target /= target.sum()
    if not rests[0] <= len(target) <= rests[1]:
        return None
    seed = int(rng.integers(2**31))
    shapes = shapes_near(target, seed, group=group)
    # Far finer than thousands of throws tell.
    options = ExactOptions(tolerance=1e-6, starts=4)
    result = solve_exact(islice(shapes, 12), target, options, group=group)
    if result.status is not Status.CONVERGED:
        return None
    points = result.hull.vertices
    return kind, points, rest_poses(points, "hull")


def _symmetric_probabilities(rng: np.random.Generator) -> tuple[Floats, str]:
    """(k,) probabilities whose equal ones a point group may map onto each other, and the group's
    name."""
    order = int(rng.integers(2, 8))
    first, second = rng.uniform(0.3, 2.5, size=2)
    if rng.random() < 0.5:
        name, others = f"C{order}v", [first] if order > 2 else [second, second, first]
    elif order == 2:
        name, others = "D2h", [first, first, second, second]
    else:
        name, others = f"D{order}h", [first, first] if rng.random() < 0.8 else []
    probabilities = np.array([1.0] * order + others)
    return probabilities / probabilities.sum(), name


@dataclass(frozen=True)
class ThrownRandomDie:
    """A random die and where it came to rest on one table, or on several in turn: counts (k,) of
    each rest, in the order of its poses, at least one."""

    die: RandomDie
    table: Table | Sequence[Table]
    counts: Integers


def throw_random_die(
    number: int,
    seed: int,
    throws: Sequence[tuple[Table | Sequence[Table], int]],
    rests: tuple[int, int] = RESTS,
) -> tuple[ThrownRandomDie, ...]:
    """Make a random die and throw it onto tables, so often onto each; the same, whoever does.

    number, seed, rests: as in `random_die`; no two dice of a seed share random numbers, but as many
    throws of one die onto several tables do. Raises InputError: no drop came to rest.
    """
    die, thrown = random_die(number, seed, rests), []
    for table, drops in throws:
        own = int(np.random.SeedSequence([seed, number, drops]).generate_state(1)[0])
        outcome = simulate(die.body, table, drops, own)
        outcome.require_rest()
        thrown.append(ThrownRandomDie(die, table, outcome.counts))
    return tuple(thrown)


def deviations(
    thrown: Sequence[ThrownRandomDie], mixture: MomentumMixture | None
) -> list[tuple[float, float, float]]:
    """Total variation between each die's simulated frequencies and its probabilities, without
    momentum and by the momentum model, in NumPy, and the mean of right probabilities."""
    # Dice are judged side by side, one on each core.
    torch.set_num_threads(1)
    deviations_of_dice = []
    for one in thrown:
        frequencies, poses = one.counts / one.counts.sum(), one.die.poses
        by_model = momentum_probabilities(poses, one.die.body, mixture)
        deviations_of_dice.append(
            (
                total_variation(frequencies, poses.probabilities),
                total_variation(frequencies, by_model),
                noise_floor(frequencies, int(one.counts.sum())),
            )
        )
    return deviations_of_dice


DEVIATIONS = (
    "dice 5d | without momentum 7.4f | worst 7.3f | momentum model 7.4f | worst by it 7.3f | "
    "right probabilities 7.4f"
)
"""Columns of a table of `summary`, with their formats."""


def summary(variations: Sequence[tuple[float, float, float]]) -> tuple[float, ...]:
    """How many dice, and means and worst of their `deviations`."""
    (geometric, momentum, floor), worst = np.mean(variations, axis=0), np.max(variations, axis=0)
    return len(variations), geometric, worst[0], momentum, worst[1], floor
