"""Search for symmetric starting shapes: random polyhedra with a point group and probabilities near
any target."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.optimize.starts.orbit_layouts import Layout, OrbitLayouts, OrbitSite
from dicedesign.optimize.starts.search import (
    NEARNESS,
    REPULSION_STEPS,
    STRETCH,
    UNEVENNESS,
    nearest_first,
)
from dicedesign.optimize.starts.shapes import (
    about_centroid,
    spread_orbits,
    start_with_probabilities,
)
from dicedesign.optimize.starts.start import FEWEST_FACETS, Start
from dicedesign.rest.equilibria import classify
from dicedesign.runtime.arrays import Floats

EVEN_STEPS: Final = 200
"""Steps that spread the facets of even shapes."""

MOST_HELPERS: Final = 2
"""Number of orbits without an outcome that are always possible; more if orbits are small."""

CLEARANCE: Final = 0.03
"""Least depth of a facet: distance of the foot of the center of mass from the line of the nearest
edge, over the circumscribed radius."""

FLOOR_PROBABILITIES: Final = 0.3
"""Least probability of an outcome on an orbit of one facet that may be the floor of a bowl."""


def symmetric_shapes_near(
    target: Floats, group: Floats, seed: int, helpers: int = 0
) -> Iterator[Start | None]:
    """Yield starting shapes with a point group as symmetry, one rest for each outcome and no other,
    and equal target probabilities on each orbit of rests, without end; None for a turn without a
    shape.

    The group acts about the origin. Outcomes are on as few orbits as possible. If equal
    probabilities are near the target, even shapes of equally distant, evenly spread facets come
    first. Then random polyhedra come in order of the distance of their probabilities from the
    target, with the most probable orbits for the most probable outcomes among orbits of one size.
    Shapes that are tied or nearly so are skipped, as their probabilities jump.

    Parameters
    ----------
    target: (k,) target probabilities, k at least 2.
    group: (g, 3, 3) as made by `point_group`.
    seed: random seed.
    helpers: least number of facets without an outcome.

    Raises ------ InputError: equal probabilities do not fill whole orbits of the group; raised by
    the call itself.
    """
    layouts, rng = OrbitLayouts(target, group), np.random.default_rng(seed)
    # A stretch along an axis that all elements keep or reverse keeps the symmetry.
    axes = np.flatnonzero((np.abs(np.diagonal(group, 0, 1, 2)) == 1.0).all(axis=0))

    def even(_: int) -> Start | None:
        layout = layouts.draw(rng)
        normals = spread_orbits([site for site, _ in layout], rng, EVEN_STEPS)
        distances = np.ones(len(layout))
        start = _start([site for site, _ in layout], normals, distances, layout, target)
        return None if start is None else start[0]

    def draw() -> tuple[Start, Floats] | None:
        layout = layouts.draw(rng)
        alone = [target[outcomes[0]] if len(outcomes) == 1 else 0.0 for _, outcomes in layout]
        floor = int(np.argmax(alone))
        if alone[floor] <= FLOOR_PROBABILITIES or rng.random() < 0.5:
            polyhedron = _pebble(layouts, layout, axes.tolist(), helpers, rng)
        else:
            polyhedron = _bowl(layouts, layout, floor, rng)
        return _start(*polyhedron, layout, target)

    return nearest_first(target, helpers, even, draw)


def _start(
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


def _pebble(
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


def _bowl(
    layouts: OrbitLayouts, layout: Layout, floor: int, rng: np.random.Generator
) -> tuple[list[OrbitSite], Floats, Floats]:
    """Half-spaces of a bowl under a low roof, as `_pebble`. Its floor is an orbit of one facet,
    onto which the body rolls over walls that lean outward."""
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
