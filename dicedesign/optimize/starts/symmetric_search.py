"""Symmetric starting shapes for any target: random polyhedra that a point group maps onto
themselves, the nearest in their odds first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.optimize.starts.half_space_odds import (
    FEWEST_FACETS,
    resting_half_spaces,
    start_with_odds,
)
from dicedesign.optimize.starts.orbit_layouts import Layout, OrbitLayouts, OrbitSite
from dicedesign.optimize.starts.search import (
    NEARNESS,
    REPULSION_STEPS,
    STRETCH,
    UNEVENNESS,
    has_helpers,
    nearest_first,
)
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.equilibria import classify
from dicedesign.runtime.arrays import Floats, Integers

EVEN_STEPS: Final = 200
"""Steps that spread the facets of even shapes."""

MOST_HELPERS: Final = 2
"""So many orbits without outcome are always possible; of small orbits, more."""

CLEARANCE: Final = 0.03
"""Least distance of the foot of the center of mass from the nearest edge's line of any facet, over
the circumscribed radius."""

FLOOR_ODDS: Final = 0.3
"""An outcome that is alone with odds above this may become the floor of a bowl."""


def symmetric_shapes_near(
    target: Floats, group: Floats, seed: int, helpers: int = 0
) -> Iterator[Start | None]:
    """Starting shapes that a point group maps onto themselves, with one rest for each outcome and
    no other, and equal target probabilities on each orbit of rests; without end. None where a turn
    found nothing, so that whoever asks can stop.

    The group acts about the origin of their points. Outcomes are spread over as few orbits as
    possible. Even shapes, equally distant facets evenly spread, come first if even odds are near
    the target; then random polyhedra, the nearest in their odds first, with the largest orbit
    probabilities for the largest outcomes among orbits of one size. None is tied or nearly so, as
    odds jump there.

    Parameters
    ----------
    target: (k,) wanted probabilities, k at least 2.
    group: (g, 3, 3) as `point_group` makes it.
    seed: of everything random.
    helpers: least number of facets without an outcome.

    Raises
    ------
    InputError: equal probabilities do not fill whole orbits of the group. It comes at once.
    """
    layouts, rng = OrbitLayouts(target, group), np.random.default_rng(seed)

    def even(_: int) -> Start | None:
        if helpers > 0:
            return None
        layout = layouts.draw(rng)
        sites = [site for site, _ in layout]
        normals = _spread_orbits(sites, rng, EVEN_STEPS)
        found = _start(normals, np.ones(len(normals)), _owners(sites), layout, target)
        return None if found is None else found[0]

    def draw() -> tuple[Start, Floats] | None:
        layout = layouts.draw(rng)
        floor = _floor(layout, target)
        if floor is None or rng.random() < 0.5:
            half_spaces = _pebble(layouts, layout, group, helpers, rng)
        else:
            half_spaces = _bowl(layouts, layout, floor, rng)
        made = _start(*half_spaces, layout, target)
        return made if made is not None and has_helpers(made[0], helpers) else None

    return nearest_first(target, even, draw)


def _start(
    normals: Floats, distances: Floats, owners: Integers, layout: Layout, target: Floats
) -> tuple[Start, Floats] | None:
    """The polyhedron of half-spaces, normals (m, 3) and distances (m,) in orbits of numbers (m,),
    and its odds (k,); None where it has other orbits of rests than the layout or is nearly tied."""
    rests = resting_half_spaces(normals, distances)
    found = start_with_odds(normals, distances, rests) if len(rests) == len(target) else None
    if found is None or not _is_clear(found[0]):
        return None
    start, odds = found
    order = _order_of_outcomes(layout, target, odds, owners[rests])
    if order is None:
        return None
    return replace(start.about_centroid(), directions=start.directions[order]), odds[order]


def _is_clear(start: Start) -> bool:
    """True where no facet nearly gains or loses stability: already exact by its symmetry, a shape
    would not be moved away from there."""
    hull = convex_hull(start.points)
    equilibria = classify(hull, hull.centroid)
    distances = equilibria.side / equilibria.edge_lengths
    depths = np.minimum.reduceat(distances, hull.facet_start[:-1])
    return bool(np.abs(depths).min() >= CLEARANCE * norms(equilibria.radii).max())


def _order_of_outcomes(
    layout: Layout, target: Floats, odds: Floats, owners: Integers
) -> Integers | None:
    """(k,) the rest that bears each outcome, from the odds (k,) of the rests and the numbers (k,)
    of their orbits; None where the rests' orbits are not as large as the layout's."""
    orbits = [np.flatnonzero(owners == number) for number in np.unique(owners)]
    found = sorted(orbits, key=lambda rests: (len(rests), -odds[rests[0]]))
    asked = sorted((some for _, some in layout), key=lambda some: (len(some), -target[some[0]]))
    if [len(rests) for rests in found] != [len(some) for some in asked]:
        return None
    order = np.empty(len(target), dtype=np.int64)
    for rests, outcomes in zip(found, asked, strict=True):
        order[list(outcomes)] = rests
    return order


def _pebble(
    layouts: OrbitLayouts,
    layout: Layout,
    group: Floats,
    helpers: int,
    rng: np.random.Generator,
) -> tuple[Floats, Floats, Integers]:
    """Half-spaces facing all ways, on the sites of a layout and at least so many more: normals
    (m, 3), distances (m,) and the numbers (m,) of their orbits."""
    sites = [site for site, _ in layout]
    fewest = max(sum(len(site.carriers) for site in sites) + helpers, FEWEST_FACETS + 1)
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
    owners = _owners(sites)
    return normals, np.exp(logarithms[owners]), owners


def _floor(layout: Layout, target: Floats) -> int | None:
    """The number of an orbit of one facet that bears more than `FLOOR_ODDS`, or None."""
    odds = [target[some[0]] if len(some) == 1 else 0.0 for _, some in layout]
    return int(np.argmax(odds)) if max(odds) > FLOOR_ODDS else None


def _bowl(
    layouts: OrbitLayouts, layout: Layout, floor: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Integers]:
    """As `_pebble`, of a bowl under a low roof, which stands on an orbit of one facet: walls that
    lean outward let the body roll onto it."""
    roof = [site for number, (site, _) in enumerate(layout) if number != floor]
    walls = _helpers(layouts, int(rng.integers(3, 9)), rng)
    sites = roof + walls
    down, owners = layout[floor][0].direction(rng), _owners(sites)
    normals = _spread_orbits(sites, rng, REPULSION_STEPS)
    is_roof = np.arange(len(sites)) < len(roof)
    angles = np.where(is_roof, rng.uniform(140.0, 175.0), rng.uniform(25.0, 75.0))
    angles = np.radians(angles + 3.0 * rng.normal(size=len(sites)))
    # The same angle to the floor for a whole orbit; what faces straight up stays.
    leaning = np.array([site.pole is None for site in sites])[owners]
    sideways = normals[leaning] - np.outer(normals[leaning] @ down, down)
    cosines, sines = (f(angles[owners][leaning])[:, None] for f in (np.cos, np.sin))
    normals[leaning] = cosines * down + sines * unit_vectors(sideways)
    distances = np.where(is_roof, rng.uniform(0.3, 1.2), rng.uniform(0.5, 1.2))
    distances = distances * np.exp(0.1 * rng.normal(size=len(sites)))
    return (
        np.concatenate([down[None], normals]),
        np.concatenate([[rng.uniform(0.3, 0.9)], distances[owners]]),
        np.concatenate([[len(sites)], owners]),
    )


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
