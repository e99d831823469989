"""Starting shapes: prisms, hendecahedra, evenly spread facets and hulls of meshes; and parts of
random ones: directions that repel each other, and solids of half-spaces with their
probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import Surface
from dicedesign.optimize.starts.orbit_layouts import OrbitSite
from dicedesign.optimize.starts.start import (
    FEWEST_FACETS,
    Start,
    check_prism,
    normalize_start,
)
from dicedesign.rest.basins import find_basins
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats, Integers


def prism(sides: int, height: float = 1.5, cap: float = 1.3) -> Start:
    """Prism with pointed caps. The side faces have the outcomes, in order around the axis.

    Own coordinates: the center at the origin, the axis along z, the base's circumscribed radius 1,
    a corner of the base in direction x.

    Parameters
    ----------
    sides: 3 to 12.
    height: height of the side faces in units of the base's circumscribed radius, positive and
        finite.
    cap: height of each pointed cap in this unit, not negative and finite; steep caps are
        unstable.

    Raises
    ------
    InputError: a parameter out of range.
    """
    check_prism(sides, height, cap)
    corner = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(corner), np.sin(corner)], axis=1)
    level = np.full((sides, 1), height / 2.0)
    apex = np.array([[0.0, 0.0, height / 2.0 + cap]])
    points = np.concatenate([np.hstack([ring, level]), np.hstack([ring, -level])])
    if cap > 0.0:
        points = np.concatenate([points, apex, -apex])
    middle = corner + np.pi / sides
    directions = np.stack([np.cos(middle), np.sin(middle), np.zeros(sides)], axis=1)
    return normalize_start(points, directions)


def _bisymmetric() -> Start:
    """Space-filling hendecahedron with two mirror planes (G. Inchbald, The Mathematical Gazette 80,
    1996); mirror images follow each other.

    Own coordinates: the mirror planes are x = 0 and y = 0, the floor is at z = -1.2, the top at
    z = 1.8, and x and y run from -2 to 2.
    """
    normals = np.array(
        [
            (1, 0, 2),
            (0, 1, 1),
            (1, 1, -1),
            (1, -1, -1),
            (2, 0, -1),
            (0, 0, -1),
            (-2, 0, -1),
            (-1, -1, -1),
            (-1, 1, -1),
            (0, -1, 1),
            (-1, 0, 2),
        ],
        dtype=np.float64,
    )
    inside = np.array([0.0, 0.0, 1.2])
    offsets = np.array([6, 3, 1, 1, 2, 0, 2, 1, 1, 3, 6]) - normals @ inside
    directions = normals / np.linalg.norm(normals, axis=1)[:, None]
    return normalize_start(polyhedron_corners(normals, offsets), directions)


def _circus() -> Start:
    """Five-sided tent, a pentagonal prism under a pentagonal pyramid. Wall and roof of each side
    follow each other, and the floor is in the middle.

    Own coordinates: every facet is tangent to the unit sphere about the origin, the floor is at
    z = -1, and the first wall faces x.
    """
    angle = 2.0 * np.pi * np.arange(5) / 5.0
    wall = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    roof = np.stack([np.cos(angle), np.sin(angle), np.full(5, 0.809)], axis=1)
    roof /= np.linalg.norm(roof, axis=1)[:, None]
    pairs = np.stack([wall, roof], axis=1).reshape(10, 3)
    directions = np.concatenate([pairs[:5], [[0.0, 0.0, -1.0]], pairs[5:]])
    return normalize_start(polyhedron_corners(directions, np.ones(11)), directions)


HENDECAHEDRA = {"bisymmetric": _bisymmetric, "circus": _circus}


def hendecahedron(kind: str) -> Start:
    """Polyhedron of eleven facets for the total of two dice; `kind` is "bisymmetric" or "circus".

    Raises InputError for another kind.
    """
    if kind not in HENDECAHEDRA:
        raise InputError(
            f"start.hendecahedron: expected one of {', '.join(HENDECAHEDRA)}, got {kind!r}"
        )
    return HENDECAHEDRA[kind]()


REPULSION_STEPS = 400
"""Steps of gradient descent on the Coulomb energy."""


def repulsion(outcomes: int, seed: int) -> Start:
    """Facets tangent to the unit sphere at points that repel each other like charges.

    Own coordinates: the unit sphere has its center at the origin.

    Parameters
    ----------
    outcomes: number of facets, at least `FEWEST_FACETS`; each has an outcome.
    seed: random seed of the first positions.

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
    return normalize_start(polyhedron_corners(points, np.ones(outcomes)), points)


def mesh_start(
    points_or_mesh: ArrayLike | Body | Surface, outcomes: int, center_of_mass: Floats | None = None
) -> Start:
    """Convex hull of a body, with the outcomes on its most probable rests.

    Own coordinates: those of the body.

    Parameters
    ----------
    points_or_mesh: as for `dicedesign.rest_poses`.
    outcomes: number of outcomes.
    center_of_mass: (3,) in the body's unit, or None for the center of the uniform
        hull.

    Raises
    ------
    InputError: the hull has fewer rests than outcomes.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    """
    body = body_of(points_or_mesh)
    poses = rest_poses(body, "hull" if center_of_mass is None else center_of_mass)
    if len(poses.normals) < outcomes:
        raise InputError(
            f"start.mesh: expected a body with at least {outcomes} rests, one for each outcome, "
            f"got {len(poses.normals)} in {body.name}; take another start"
        )
    hull = poses.hull
    # Rounded corners are not exactly in the plane of a merged facet. Corners where mean planes meet
    # are, so that it stays one facet.
    offsets = ((hull.vertices[hull.tail] - hull.centroid) * hull.normals[hull.facet]).sum(-1)
    heights = np.add.reduceat(offsets, hull.facet_start[:-1]) / np.diff(hull.facet_start)
    corners = polyhedron_corners(hull.normals, heights) + hull.centroid
    return normalize_start(corners, poses.normals[:outcomes], poses.notes)


def about_centroid(start: Start) -> Start:
    """Move a start so that its centroid is at 0."""
    centroid = convex_hull(start.points).centroid
    origin = start.origin + start.scale * centroid
    return replace(start, points=start.points - centroid, origin=origin)


def start_with_probabilities(
    normals: Floats, distances: Floats, outcomes: int
) -> tuple[Start, Floats, Integers] | None:
    """Start from half-spaces `normals[i] . x <= distances[i]`, (m, 3) and (m,), with the outcomes
    on its rests. None if it is tied or no solid, or has another number of rests.

    Returns the start, with directions in the order of the half-spaces, and the probabilities (k,)
    and half-spaces (k,) of the outcomes.
    """
    try:
        points = polyhedron_corners(normals, distances)
        hull = convex_hull(points)
        facets = np.flatnonzero(classify(hull, hull.centroid).stable)
        if len(facets) != outcomes:
            return None
        basins = find_basins(hull, hull.centroid)
    except DiceError:
        return None
    if len(basins) > 1 or not np.array_equal(basins[0].paths.rests, facets):
        return None
    bearing = np.argmax(hull.normals[facets] @ unit_vectors(normals).T, axis=1)
    order = np.argsort(bearing)
    probabilities = basins[0].areas[order] / (4.0 * np.pi)
    return normalize_start(points, hull.normals[facets[order]]), probabilities, bearing[order]


ANYWHERE = OrbitSite(np.eye(3), np.eye(3)[None])
"""Site of a facet without images."""


def spread_orbits(sites: Sequence[OrbitSite], rng: np.random.Generator, steps: int) -> Floats:
    """Random unit vectors (m, 3) in whole orbits that repel each other like charges, after a number
    of steps of gradient descent on the Coulomb energy. The first of each orbit stays on its site.
    """
    owner = np.repeat(np.arange(len(sites)), [len(site.carriers) for site in sites])
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


def spread_directions(count: int, rng: np.random.Generator, steps: int) -> Floats:
    """Random unit vectors (count, 3) that repel each other; see `spread_orbits`."""
    return spread_orbits([ANYWHERE] * count, rng, steps)
