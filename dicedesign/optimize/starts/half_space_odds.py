"""Solids given by half-spaces: spread evenly around a sphere, their rests and odds."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import QhullError

from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.hulls.numpy_hull import hull_triangles
from dicedesign.geometry.sphere import norms
from dicedesign.optimize.starts.start import Start, normalised_start
from dicedesign.rest.basins import find_basins
from dicedesign.runtime.arrays import Floats, Integers


def resting_half_spaces(normals: Floats, distances: Floats) -> Integers:
    """Numbers (k,) of the half-spaces `normals[i] . x <= distances[i]` on whose planes the uniform
    solid that they bound comes to rest; none where they bound no solid.

    A quick look, which decides ties either way: the body rests on a facet if the foot of its center
    of mass on the facet's plane lies in all half-spaces.
    normals: (m, 3), not necessarily unit; distances: (m,), positive.
    """
    lengths = norms(normals)
    units, distances = normals / lengths[:, None], distances / lengths
    polar = units / distances[:, None]
    try:
        triangles, neighbors = hull_triangles(polar)
    except QhullError:
        return np.empty(0, dtype=np.int64)
    a, b, c = polar[triangles.T]
    planes = np.linalg.cross(b - a, c - a)
    levels = (planes * a).sum(-1)
    if not (levels > 0.0).all():
        return np.empty(0, dtype=np.int64)
    corners = planes / levels[:, None]
    # Every triangle of the polar body is a corner. Facet j, one of three there, runs into it along
    # an edge from the corner across the edge from j to the following one.
    foot = (units * distances[:, None])[np.roll(triangles, -1, axis=1)]
    before, at = corners[neighbors], corners[:, None]
    volumes = (foot * np.linalg.cross(before, at)).sum(-1)
    center = (volumes[..., None] * (foot + before + at)).sum((0, 1)) / (4.0 * volumes.sum())
    heights = distances - units @ center
    feet = center + units * heights[:, None]
    inside = feet @ units.T <= distances
    np.fill_diagonal(inside, True)
    return np.flatnonzero(inside.all(axis=1) & (heights > 0.0))


def start_with_odds(
    normals: Floats, distances: Floats, rests: Integers
) -> tuple[Start, Floats] | None:
    """A start whose outcomes are on some of its half-spaces, and their odds (k,); None where those
    are not its rests, where it has others, and where it is tied.

    normals (m, 3) and distances (m,) as in `resting_half_spaces`; rests: (k,) numbers of the
    half-spaces that bear the outcomes, in this order.
    """
    try:
        points = polyhedron_corners(normals, distances)
        hull = convex_hull(points)
        basins = find_basins(hull, hull.centroid)
    except DiceError:
        return None
    facets = np.argmax(normals[rests] / norms(normals[rests])[:, None] @ hull.normals.T, axis=1)
    found = basins[0].paths.rests
    if len(basins) > 1 or not np.array_equal(np.sort(facets), found):
        return None
    odds = basins[0].areas[np.searchsorted(found, facets)] / (4.0 * np.pi)
    return normalised_start(points, hull.normals[facets]), odds


FEWEST_FACETS: Final = 4
"""A body bounded by planes has at least so many facets."""


REPULSION_STEPS: Final = 400
"""Steps of gradient descent on the Coulomb energy."""


def repulsion(outcomes: int, seed: int) -> Start:
    """Facets tangent to the unit sphere at points that repel each other like charges.

    Own coordinates: the unit sphere has its center at the origin.

    Parameters
    ----------
    outcomes: number of facets, at least `FEWEST_FACETS`; all carry an outcome.
    seed: of the random first positions.

    Raises
    ------
    InputError: fewer than 4 outcomes.
    """
    if outcomes < FEWEST_FACETS:
        raise InputError(
            f"start.repulsion: expected at least {FEWEST_FACETS} outcomes, got {outcomes}; a "
            "body bounded by fewer facets does not exist, start from a prism"
        )
    points = spread_directions(outcomes, np.random.default_rng(seed), REPULSION_STEPS)
    return normalised_start(polyhedron_corners(points, np.ones(outcomes)), points)


def spread_directions(count: int, rng: np.random.Generator, steps: int) -> Floats:
    """(count, 3) random unit vectors that repel each other like charges, after so many steps of
    gradient descent on the Coulomb energy."""
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    for step in range(steps):
        offset = points[:, None, :] - points[None, :, :]
        distance = np.sqrt((offset * offset).sum(-1)) + np.eye(count)
        force = (offset / distance[..., None] ** 3).sum(axis=1)
        force -= points * (force * points).sum(-1)[:, None]
        length = np.sqrt((force * force).sum(-1)).max()
        reach = 0.3 / np.sqrt(count) * (1.0 - step / steps)
        points += force * (reach / max(length, 1.0))
        points /= np.linalg.norm(points, axis=1)[:, None]
    return points
