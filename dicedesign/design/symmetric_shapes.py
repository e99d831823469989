"""Symmetric starting shapes for any target: random polyhedra that a point group maps onto
themselves, the nearest in their odds first."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.orbit_layouts import Layout, OrbitLayouts, OrbitSite
from dicedesign.design.starts import FEWEST_FACETS, Start
from dicedesign.design.symmetric_coordinates import images_of_directions
from dicedesign.errors import DiceError
from dicedesign.geometry.halfspaces import polyhedron_corners
from dicedesign.geometry.hull import convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.rest.equilibria import Equilibria, classify
from dicedesign.rest.probabilities import find_basins

__all__ = ["symmetric_shapes_near"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

EVEN_SHAPES: Final = 2
"""Shapes of equally distant, evenly spread facets that are tried first."""

EVEN_STEPS: Final = 200
"""Steps that spread their facets."""

FIRST_DRAW: Final = 50
"""Polyhedra drawn before the first of them is proposed."""

DRAW_GROWTH: Final = 1.5
"""How many times as large each later draw is."""

PROPOSED: Final = 3
"""How many of all that were drawn are proposed after each draw."""

REPULSION_STEPS: Final = 10
"""Steps that keep random facets from lying too close to each other."""

MOST_HELPERS: Final = 2
"""So many orbits without outcome are always possible; of small orbits, more."""

CLEARANCE: Final = 0.03
"""Least distance of the foot of the center of mass from the nearest edge's line of any facet, over
the circumscribed radius."""

UNEVENNESS: Final = 0.6
"""Largest standard deviation of the logarithms of the distances of orbits."""

NEARNESS: Final = 1.5
"""An orbit in favour is nearer than others by a factor of up to the exponential of this."""

FLOOR_ODDS: Final = 0.3
"""An outcome that is alone with odds above this may become the floor of a bowl."""

STRETCH: Final = (-1.5, 1.0)
"""Range of the logarithm by which a polyhedron is stretched along one axis."""


def symmetric_shapes_near(target: Floats, group: Floats, seed: int) -> Iterator[Start]:
    """Starting shapes that a point group maps onto themselves, with one rest for each outcome and
    no other, and equal target probabilities on each orbit of rests; without end.

    The group acts about the origin of their points. Outcomes are spread over as few orbits as
    possible. After each draw of random polyhedra, the nearest in their odds of all so far come
    first, with the largest orbit probabilities for the largest outcomes among orbits of one size.
    None is tied or nearly so, as odds jump there.

    Parameters
    ----------
    target: (k,) wanted probabilities, k at least 2.
    group: (g, 3, 3) as `point_group` makes it.
    seed: of everything random.

    Raises
    ------
    InputError: equal probabilities do not fill whole orbits of the group. It comes at once.
    """
    return _nearest_first(OrbitLayouts(target, group), target, group, np.random.default_rng(seed))


def _nearest_first(
    layouts: OrbitLayouts, target: Floats, group: Floats, rng: np.random.Generator
) -> Iterator[Start]:
    for _ in range(EVEN_SHAPES):
        layout = layouts.draw(rng)
        normals = _spread_orbits([site for site, _ in layout], rng, EVEN_STEPS)
        even = _shape(normals, np.ones(len(normals)), layout, target, group)
        if even is not None:
            yield even[1]
    pool: list[tuple[float, Start]] = []
    for turn in count():
        for _ in range(int(FIRST_DRAW * DRAW_GROWTH**turn)):
            layout = layouts.draw(rng)
            floor = _floor(layout, target)
            if floor is None or rng.random() < 0.5:
                normals, distances = _pebble(layouts, layout, group, rng)
            else:
                normals, distances = _bowl(layouts, layout, floor, rng)
            drawn = _shape(normals, distances, layout, target, group)
            if drawn is not None:
                pool.append(drawn)
        pool.sort(key=lambda entry: -entry[0])
        for _ in range(min(PROPOSED, len(pool))):
            yield pool.pop()[1]


def _shape(
    normals: Floats, distances: Floats, layout: Layout, target: Floats, group: Floats
) -> tuple[float, Start] | None:
    """The polyhedron of half-spaces, normals (m, 3) and distances (m,), and the squared distance of
    its odds from the target; None where it has other orbits of rests than the layout or is tied."""
    try:
        points = polyhedron_corners(normals, distances)
        hull = convex_hull(points)
        if not _is_clear(classify(hull, hull.centroid), len(target)):
            return None
        basins = find_basins(hull, hull.centroid)
        rests = basins[0].equilibria.hull.normals[basins[0].paths.rests]
        images = images_of_directions(rests, group)
    except DiceError:
        return None
    if len(basins) > 1 or len(rests) != len(target):
        return None
    odds = basins[0].areas / (4.0 * np.pi)
    order = _order_of_outcomes(layout, target, odds, images)
    if order is None:
        return None
    scale = float(np.abs(points).max())
    start = Start(points / scale, rests[order], np.zeros(3), scale)
    return float(((odds[order] - target) ** 2).sum()), start


def _is_clear(equilibria: Equilibria, outcomes: int) -> bool:
    """Whether a body has so many rests, and no facet nearly gains or loses stability: already exact
    by its symmetry, it would not be moved away from there."""
    if equilibria.stable.sum() != outcomes:
        return False
    distances = equilibria.side / equilibria.edge_lengths
    depths = np.minimum.reduceat(distances, equilibria.hull.facet_start[:-1])
    return bool(np.abs(depths).min() >= CLEARANCE * norms(equilibria.radii).max())


def _order_of_outcomes(
    layout: Layout, target: Floats, odds: Floats, images: Integers
) -> Integers | None:
    """(k,) the rest that bears each outcome, from the odds (k,) of the rests and what the elements
    map them onto (g, k); None where the rests' orbits are not as large as the layout's."""
    orbits = [list(dict.fromkeys(images[:, first])) for first in np.unique(images.min(axis=0))]
    found = sorted(orbits, key=lambda rests: (len(rests), -odds[rests[0]]))
    asked = sorted((some for _, some in layout), key=lambda some: (len(some), -target[some[0]]))
    if [len(rests) for rests in found] != [len(some) for some in asked]:
        return None
    order = np.empty(len(target), dtype=np.int64)
    for rests, outcomes in zip(found, asked, strict=True):
        order[list(outcomes)] = rests
    return order


def _pebble(
    layouts: OrbitLayouts, layout: Layout, group: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Half-spaces facing all ways, on the sites of a layout and some more: normals (m, 3) and
    distances (m,)."""
    sites = [site for site, _ in layout]
    fewest = max(sum(len(site.carriers) for site in sites), FEWEST_FACETS + 1)
    facets = fewest
    if rng.random() < 0.5:
        facets += int(rng.integers(max(fewest + 4, MOST_HELPERS * layouts.smallest) + 1))
    sites += _helpers(layouts, facets - sum(len(site.carriers) for site in sites), rng)
    normals = _spread_orbits(sites, rng, REPULSION_STEPS)
    logarithms = UNEVENNESS * rng.random() ** 2 * rng.normal(size=len(sites))
    if rng.random() < 0.5:
        logarithms[rng.integers(len(sites))] -= rng.uniform(0.0, NEARNESS)
    # Stretching along an axis that all elements keep or reverse leaves the symmetry.
    kept = np.flatnonzero((np.abs(np.diagonal(group, 0, 1, 2)) == 1.0).all(axis=0))
    if len(kept) and rng.random() < 0.5:
        normals[:, kept[rng.integers(len(kept))]] *= np.exp(-rng.uniform(*STRETCH))
    return normals, np.exp(logarithms[_owners(sites)])


def _floor(layout: Layout, target: Floats) -> int | None:
    """The number of an orbit of one facet that bears more than `FLOOR_ODDS`, or None."""
    odds = [target[some[0]] if len(some) == 1 else 0.0 for _, some in layout]
    return int(np.argmax(odds)) if max(odds) > FLOOR_ODDS else None


def _bowl(
    layouts: OrbitLayouts, layout: Layout, floor: int, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Half-spaces of a bowl under a low roof, which stands on an orbit of one facet: walls that
    lean outward let the body roll onto it."""
    roof = [site for number, (site, _) in enumerate(layout) if number != floor]
    walls = _helpers(layouts, int(rng.integers(3, 9)), rng)
    sites = roof + walls
    down, owner = layout[floor][0].direction(rng), _owners(sites)
    normals = _spread_orbits(sites, rng, REPULSION_STEPS)
    is_roof = np.arange(len(sites)) < len(roof)
    angles = np.where(is_roof, rng.uniform(140.0, 175.0), rng.uniform(25.0, 75.0))
    angles = np.radians(angles + 3.0 * rng.normal(size=len(sites)))
    # The same angle to the floor for a whole orbit; what faces straight up stays.
    leaning = np.array([site.pole is None for site in sites])[owner]
    sideways = normals[leaning] - np.outer(normals[leaning] @ down, down)
    cosines, sines = (f(angles[owner][leaning])[:, None] for f in (np.cos, np.sin))
    normals[leaning] = cosines * down + sines * unit_vectors(sideways)
    distances = np.where(is_roof, rng.uniform(0.3, 1.2), rng.uniform(0.5, 1.2))
    distances = distances * np.exp(0.1 * rng.normal(size=len(sites)))
    normals = np.concatenate([down[None], normals])
    return normals, np.concatenate([[rng.uniform(0.3, 0.9)], distances[owner]])


def _helpers(layouts: OrbitLayouts, facets: int, rng: np.random.Generator) -> list[OrbitSite]:
    """Sites of orbits without outcome that have so many facets or a little more."""
    sites: list[OrbitSite] = []
    while sum(len(site.carriers) for site in sites) < facets:
        sites.append(layouts.helper(rng))
    return sites


def _owners(sites: list[OrbitSite]) -> Integers:
    """(m,) the orbit of each facet."""
    return np.repeat(np.arange(len(sites)), [len(site.carriers) for site in sites])


def _spread_orbits(sites: list[OrbitSite], rng: np.random.Generator, steps: int) -> Floats:
    """(m, 3) random directions in whole orbits that repel each other like charges, after so many
    steps of gradient descent on the Coulomb energy that keep the first of each orbit on its site;
    the counterpart of `spread_directions`."""
    owner = _owners(sites)
    carriers = np.concatenate([site.carriers for site in sites])
    projections = np.stack([site.projection for site in sites])
    firsts = np.stack([site.direction(rng) for site in sites])
    own = np.zeros((len(sites), len(owner)))
    own[np.arange(len(sites)), np.searchsorted(owner, np.arange(len(sites)))] = 1.0
    for step in range(steps):
        offset = firsts[:, None, :] - np.einsum("mij,mj->mi", carriers, firsts[owner])
        force = (offset / (norms(offset) + own)[..., None] ** 3).sum(axis=1)
        force = np.einsum("oij,oj->oi", projections, force)
        force -= firsts * (force * firsts).sum(-1)[:, None]
        reach = 0.3 / np.sqrt(len(owner)) * (1.0 - step / steps)
        firsts = unit_vectors(firsts + force * (reach / max(norms(force).max(), 1.0)))
    return np.einsum("mij,mj->mi", carriers, firsts[owner])
