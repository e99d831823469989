"""Searches for starting shapes: random polyhedra with probabilities near any target, needles
between them, and variations of a given shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from typing import TypeAlias

import numpy as np

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.optimize.coordinates import coordinates_of
from dicedesign.optimize.starts.needles import needle_near
from dicedesign.optimize.starts.orbit_layouts import Layout, OrbitLayouts, OrbitSite
from dicedesign.optimize.starts.shapes import (
    about_centroid,
    repulsion,
    spread_directions,
    spread_orbits,
    start_with_probabilities,
)
from dicedesign.optimize.starts.start import FEWEST_FACETS, Start
from dicedesign.rest.equilibria import classify
from dicedesign.runtime.arrays import Floats

Draws: TypeAlias = tuple[Callable[[int], Start | None], Callable[[], tuple[Start, Floats] | None]]
"""Makes even shape number n from 0, and draws a random polyhedron with its probabilities (k,)."""


def shapes_near(
    target: Floats, seed: int, helpers: int = 0, group: Floats | None = None
) -> Iterator[Start | None]:
    """Yield starting shapes with one rest for each outcome and no other, without end; None for a
    turn without a shape.

    If equal probabilities are near the target, polyhedra of equally distant, evenly spread facets
    come first. Then random polyhedra, some facets of which are no rests, come in order of the
    distance of their probabilities from the target, with the most probable rest for the most
    probable outcome and so on. Without a symmetry, needles come between them (`needle_near`), whose
    probabilities are near any target.

    With a symmetry, outcomes are on as few orbits of facets as possible, with equal target
    probabilities on each, and the most probable orbits are for the most probable outcomes among
    orbits of one size. Shapes that are tied or nearly so are skipped, as their probabilities jump.

    Parameters
    ----------
    target: (k,) probabilities, k at least 2.
    seed: random seed.
    helpers: least number of facets without an outcome.
    group: (g, 3, 3) as made by `point_group`, the symmetry of the shapes, which acts about the
        origin; None for shapes without one.

    Raises
    ------
    InputError: equal probabilities do not fill whole orbits of the group; raised by the call
        itself.
    """
    rng = np.random.default_rng(seed)
    if group is not None:
        return nearest_first(target, helpers, *_symmetric_polyhedra(target, group, helpers, rng))
    return nearest_first(
        target,
        helpers,
        *_polyhedra(target, seed, helpers, rng),
        another=lambda: needle_near(target, rng),
    )


def _polyhedra(target: Floats, seed: int, helpers: int, rng: np.random.Generator) -> Draws:
    """Draws of shapes without symmetry."""
    outcomes = len(target)
    place = np.argsort(np.argsort(-target, kind="stable"), kind="stable")

    def even(number: int) -> Start | None:
        if outcomes < FEWEST_FACETS:
            return None
        shape = repulsion(outcomes, seed + number)
        return replace(shape, directions=rng.permutation(shape.directions))

    def draw() -> tuple[Start, Floats] | None:
        pebble = rng.random() < 0.5
        normals, distances = _pebble(outcomes + helpers, rng) if pebble else _bowl(outcomes, rng)
        candidate = start_with_probabilities(normals, distances, outcomes)
        if candidate is None:
            return None
        start, probabilities, _ = candidate
        order = np.argsort(-probabilities, kind="stable")[place]
        return replace(start, directions=start.directions[order]), probabilities[order]

    return even, draw


def _pebble(outcomes: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half-spaces in all directions: normals (m, 3) and distances (m,)."""
    fewest = max(outcomes, FEWEST_FACETS + 1)
    facets = int(rng.integers(fewest, 2 * fewest + 5))
    normals = spread_directions(facets, rng, REPULSION_STEPS)
    distances = np.exp(rng.uniform(0.0, UNEVENNESS) * rng.normal(size=facets))
    if rng.random() < 0.5:
        distances[0] *= np.exp(-rng.uniform(0.0, NEARNESS))
    normals[:, 2] *= np.exp(-rng.uniform(*STRETCH))
    return normals, distances


def _bowl(outcomes: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half-spaces of a bowl under a low roof: normals (m, 3) and distances (m,). As its walls lean
    outward, the body rolls onto its bottom with a probability of up to two thirds."""
    roof, walls = outcomes - 1 + int(rng.integers(0, 2)), int(rng.integers(3, 9))
    normals = np.concatenate(
        [
            [[0.0, 0.0, -1.0]],
            _cone(roof, np.radians(rng.uniform(5.0, 40.0)), rng),
            _cone(walls, np.radians(180.0 - rng.uniform(25.0, 75.0)), rng),
        ]
    )
    normals += 0.05 * rng.normal(size=normals.shape)
    distances = np.exp(0.1 * rng.normal(size=len(normals)))
    distances[0] = rng.uniform(0.3, 0.9)
    distances[1 : 1 + roof] *= rng.uniform(0.3, 1.2)
    distances[1 + roof :] *= rng.uniform(0.5, 1.2)
    return normals, distances


def _cone(facets: int, angle: float, rng: np.random.Generator) -> Floats:
    """Unit vectors (facets, 3) at an angle to the z axis, spread around it."""
    turns = (np.arange(facets) + rng.random() + 0.3 * rng.normal(size=facets)) / facets
    around = np.stack([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)], axis=1)
    return np.column_stack([np.sin(angle) * around, np.full(facets, np.cos(angle))])


EVEN_SHAPES = 2
"""Shapes of evenly spread facets that come first if equal probabilities are near the target."""

FAR = 0.3
"""Distance of probabilities, the root of their summed squared differences, above which a polyhedron
is proposed only if there is nothing else."""

DRAWN = 30
"""Limit on the polyhedra drawn in each turn."""

DRAWN_OUTCOMES = 2000
"""Limit on the outcomes of all polyhedra of a turn, unless it is one."""

PROPOSED = 2
"""Limit on the polyhedra proposed in each turn."""

REPULSION_STEPS = 10
"""Steps of repulsion between random facets."""

UNEVENNESS = 0.6
"""Limit on the standard deviation of the logarithms of facet distances."""

NEARNESS = 1.5
"""Limit on the logarithm of the factor by which a preferred facet is nearer."""

STRETCH = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def nearest_first(
    target: Floats,
    helpers: int,
    even: Callable[[int], Start | None],
    draw: Callable[[], tuple[Start, Floats] | None],
    another: Callable[[], Start | None] = lambda: None,
) -> Iterator[Start | None]:
    """Yield starting shapes without end, and None for a turn without a shape.

    Even shapes come first, each in a turn of its own, if equal probabilities are near the target.
    Each later turn adds random polyhedra to a pool. It proposes the nearest of the pool if they are
    near, then another shape, and the nearest of the pool if there was neither.

    target: (k,) probabilities; helpers: least number of facets without an outcome, which even
    shapes do not have; even: makes even shape number n from 0; draw: makes a random polyhedron and
    its probabilities (k,), or None; another: makes the other shape, or None.
    """

    def suits(start: Start) -> bool:
        least = outcomes + helpers
        return helpers == 0 or len(convex_hull(start.points).normals) >= least

    outcomes = len(target)
    if np.linalg.norm(target - 1.0 / outcomes) < FAR:
        for number in range(EVEN_SHAPES):
            yield even(number) if helpers == 0 else None
    pool: list[tuple[float, Start]] = []
    while True:
        for _ in range(max(min(DRAWN, DRAWN_OUTCOMES // outcomes), 1)):
            if (drawn := draw()) is not None and suits(drawn[0]):
                pool.append((float(np.linalg.norm(drawn[1] - target)), drawn[0]))
        pool.sort(key=lambda entry: -entry[0])
        near = sum(distance < FAR for distance, _ in pool[-PROPOSED:])
        for _ in range(near):
            yield pool.pop()[1]
        if (other := another()) is not None and suits(other):
            yield other
        elif near == 0:
            yield pool.pop()[1] if pool else None


EVEN_STEPS = 200
"""Steps that spread the facets of even shapes."""

MOST_HELPERS = 2
"""Number of orbits without an outcome that are always possible; more if orbits are small."""

CLEARANCE = 0.03
"""Least depth of a facet: distance of the foot of the center of mass from the line of the nearest
edge, over the circumscribed radius."""

FLOOR_PROBABILITIES = 0.3
"""Least probability of an outcome on an orbit of one facet that may be the floor of a bowl."""


def _symmetric_polyhedra(
    target: Floats, group: Floats, helpers: int, rng: np.random.Generator
) -> Draws:
    """Draws of shapes with a symmetry."""
    layouts = OrbitLayouts(target, group)
    # A stretch along an axis that all elements keep or reverse keeps the symmetry.
    axes = np.flatnonzero((np.abs(np.diagonal(group, 0, 1, 2)) == 1.0).all(axis=0))

    def even(_: int) -> Start | None:
        layout = layouts.draw(rng)
        normals = spread_orbits([site for site, _ in layout], rng, EVEN_STEPS)
        distances = np.ones(len(layout))
        start = _start_on_orbits([site for site, _ in layout], normals, distances, layout, target)
        return None if start is None else start[0]

    def draw() -> tuple[Start, Floats] | None:
        layout = layouts.draw(rng)
        alone = [target[outcomes[0]] if len(outcomes) == 1 else 0.0 for _, outcomes in layout]
        floor = int(np.argmax(alone))
        if alone[floor] <= FLOOR_PROBABILITIES or rng.random() < 0.5:
            polyhedron = _symmetric_pebble(layouts, layout, axes.tolist(), helpers, rng)
        else:
            polyhedron = _symmetric_bowl(layouts, layout, floor, rng)
        return _start_on_orbits(*polyhedron, layout, target)

    return even, draw


def _start_on_orbits(
    sites: list[OrbitSite], normals: Floats, distances: Floats, layout: Layout, target: Floats
) -> tuple[Start, Floats] | None:
    """Polyhedron of half-spaces on sites, with normals (m, 3) and distances (s,) of the orbits, and
    its probabilities (k,). None if its rests have other orbits than the layout, or it is nearly
    tied.
    """
    owners = np.repeat(np.arange(len(sites)), [site.size for site in sites])
    candidate = start_with_probabilities(normals, distances[owners], len(target))
    if candidate is None:
        return None
    start, probabilities, rests = candidate
    hull = convex_hull(start.points)
    equilibria = classify(hull, hull.centroid)
    feet = equilibria.side / equilibria.edge_lengths
    depths = np.minimum.reduceat(feet, hull.facet_start[:-1])
    # If symmetry makes a shape exact, no step moves it away from a near tie.
    if np.abs(depths).min() < CLEARANCE * norms(equilibria.radii).max():
        return None
    orbits = [np.flatnonzero(owners[rests] == number) for number in np.unique(owners[rests])]
    own_orbits = sorted(orbits, key=lambda orbit: (len(orbit), -probabilities[orbit[0]]))
    wanted_orbits = sorted(
        (outcomes for _, outcomes in layout),
        key=lambda outcomes: (len(outcomes), -target[outcomes[0]]),
    )
    if [len(orbit) for orbit in own_orbits] != [len(outcomes) for outcomes in wanted_orbits]:
        return None
    order = np.empty(len(target), dtype=np.int64)
    order[np.concatenate(wanted_orbits)] = np.concatenate(own_orbits)
    return replace(about_centroid(start), directions=start.directions[order]), probabilities[order]


def _symmetric_pebble(
    layouts: OrbitLayouts,
    layout: Layout,
    axes: list[int],
    helpers: int,
    rng: np.random.Generator,
) -> tuple[list[OrbitSite], Floats, Floats]:
    """Half-spaces in all directions, on the sites of a layout and a number of helper sites or more:
    sites, normals (m, 3), and distances (s,) of the orbits."""
    sites = [site for site, _ in layout]
    fewest = max(sum(site.size for site in sites) + helpers, FEWEST_FACETS + 1)
    facets = fewest
    if rng.random() < 0.5:
        facets += int(rng.integers(max(fewest + 4, MOST_HELPERS * layouts.smallest) + 1))
    sites += _helpers(layouts, facets - sum(site.size for site in sites), rng)
    normals = spread_orbits(sites, rng, REPULSION_STEPS)
    logarithms = UNEVENNESS * rng.random() ** 2 * rng.normal(size=len(sites))
    if rng.random() < 0.5:
        logarithms[rng.integers(len(sites))] -= rng.uniform(0.0, NEARNESS)
    if axes and rng.random() < 0.5:
        normals[:, axes[rng.integers(len(axes))]] *= np.exp(-rng.uniform(*STRETCH))
    return sites, normals, np.exp(logarithms)


def _symmetric_bowl(
    layouts: OrbitLayouts, layout: Layout, floor: int, rng: np.random.Generator
) -> tuple[list[OrbitSite], Floats, Floats]:
    """Half-spaces of a bowl under a low roof, as `_symmetric_pebble`. Its floor is an orbit of one
    facet, onto which the body rolls over walls that lean outward."""
    roof = [site for number, (site, _) in enumerate(layout) if number != floor]
    sites = roof + _helpers(layouts, int(rng.integers(3, 9)), rng)
    bottom = layout[floor][0]
    down = bottom.direction(rng)
    normals = spread_orbits(sites, rng, REPULSION_STEPS)
    is_roof = np.arange(len(sites)) < len(roof)
    angles = np.where(is_roof, rng.uniform(140.0, 175.0), rng.uniform(25.0, 75.0))
    angles = np.radians(angles + 3.0 * rng.normal(size=len(sites)))
    # All facets of an orbit have one angle to the floor; facets on the axis stay.
    sizes = [site.size for site in sites]
    leaning = np.repeat([site.pole is None for site in sites], sizes)
    sideways = normals[leaning] - np.outer(normals[leaning] @ down, down)
    lean = np.repeat(angles, sizes)[leaning][:, None]
    normals[leaning] = np.cos(lean) * down + np.sin(lean) * unit_vectors(sideways)
    distances = np.where(is_roof, rng.uniform(0.3, 1.2), rng.uniform(0.5, 1.2))
    distances = distances * np.exp(0.1 * rng.normal(size=len(sites)))
    heights = np.concatenate([[rng.uniform(0.3, 0.9)], distances])
    return [bottom, *sites], np.concatenate([down[None], normals]), heights


def _helpers(layouts: OrbitLayouts, facets: int, rng: np.random.Generator) -> list[OrbitSite]:
    """Random sites of orbits without an outcome, with a total number of facets or more."""
    sites: list[OrbitSite] = []
    while sum(site.size for site in sites) < facets:
        sites.append(layouts.helper(rng))
    return sites


FIRST_VARIATION = 0.01
"""Size of the first variation of a start: the standard deviation of normals and of logarithms of
distances."""

LARGEST_VARIATION = 0.3
"""Limit of the size of variations."""


def shapes_like(start: Start, seed: int, group: Floats | None = None) -> Iterator[Start]:
    """Yield a start, then variations with facets turned and shifted more and more, without end.
    Variations that are no solids are skipped.

    Parameters
    ----------
    start: the shape.
    seed: random seed of the variations.
    group: (g, 3, 3) point group about the origin, the symmetry of the start and its variations, or
        None.

    Raises
    ------
    InputError: the start does not have the symmetry.
    """
    yield start
    hull = convex_hull(start.points)
    coordinates, parameters = coordinates_of(start.points, hull.centroid, group)
    facets = np.argmax(start.directions @ hull.normals.T, axis=1)
    rng = np.random.default_rng(seed)
    for number in count(1):
        size = LARGEST_VARIATION * (1.0 - np.exp(-number * FIRST_VARIATION / LARGEST_VARIATION))
        moved = parameters + size * rng.normal(size=parameters.shape)
        try:
            points = coordinates.shape(moved).points
            normals = convex_hull(points).normals
        except (DiceError, np.linalg.LinAlgError):
            continue
        nearest = np.argmax(hull.normals[facets] @ normals.T, axis=1)
        yield replace(start, points=points, directions=normals[nearest])
