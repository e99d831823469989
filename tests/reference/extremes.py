"""Bodies with few rests, large hulls, and bodies with points that are no corners."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull as Triangulation

from dicedesign.geometry.sphere import unit_vectors
from tests.reference.problem import Problem
from tests.reference.solids import box, icosphere, platonic

ANTIPODE_SEEDS = (5, 102, 255, 278, 463, 482, 623, 874)
"""Seeds of `lopsided_needle` for which a basin contains the antipode of its own normal."""


def weighted_sphere() -> Problem:
    """A sphere of 1280 triangles with its center of mass near a corner of a facet: one rest."""
    points = icosphere(3).points
    triangle = points[Triangulation(points).simplices[0]]
    inner = 0.85 * triangle[0] + 0.15 * triangle.mean(axis=0)
    return Problem(points, 0.97 * inner, shares=np.ones(1), rests=1)


def lens() -> Problem:
    """A flat body with slanted rims: two rests."""
    angles = 2.0 * np.pi * np.arange(7) / 7
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(7)])
    lid = 0.8 * ring
    shift = np.array([0.0, 0.0, 0.1])
    points = np.concatenate([ring, lid + shift, lid - shift])
    return Problem(points, np.zeros(3), shares=np.full(2, 0.5), rests=2)


def lopsided_needle(seed: int) -> Problem:
    """A long thin body of seven points with a random center of mass."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(7, 3)) * [0.2, 0.2, 1.0]
    corners = points[np.unique(Triangulation(points).simplices)]
    return Problem(points, rng.dirichlet(np.full(len(corners), 0.5)) @ corners)


def large(points: int, seed: int = 0) -> Problem:
    """The hull of random points on an ellipsoid, uniform."""
    directions = unit_vectors(np.random.default_rng(seed).normal(size=(points, 3)))
    return Problem(directions * [1.0, 0.8, 0.7])


def globe(rings: int, sides: int) -> Problem:
    """Points of a sphere on circles of latitude, 8 x rings x sides in all: facets are trapezoids,
    and the coordinates have the symmetry of a box without rounding."""
    latitude = 0.5 * np.pi * (np.arange(rings) + 0.5)[:, None] / rings
    longitude = 0.5 * np.pi * (np.arange(sides) + 0.5)[None, :] / sides
    octant = np.stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude) + 0.0 * longitude,
        ],
        axis=-1,
    ).reshape(-1, 3)
    points = np.concatenate([octant * signs for signs in product([-1.0, 1.0], repeat=3)])
    mirrors = tuple(np.diag(s) for s in ([-1.0, 1, 1], [1.0, -1, 1], [1.0, 1, -1]))
    return Problem(points, np.zeros(3), symmetries=mirrors)


def with_duplicates() -> Problem:
    """A box with each corner five times, in random order."""
    problem = box(1.0, 2.0, 3.0)
    order = np.random.default_rng(0).permutation(np.repeat(np.arange(8), 5))
    return replace(problem, points=problem.points[order], center=None)


def with_extras() -> Problem:
    """An icosahedron with 200 more points on its edges and 200 on its facets, up to rounding."""
    problem, rng = platonic("icosahedron"), np.random.default_rng(0)
    triangles = problem.points[Triangulation(problem.points).simplices[rng.integers(20, size=400)]]
    weights = rng.dirichlet(np.ones(3), size=400)
    weights[:200, 2] = 0.0
    weights /= weights.sum(axis=1)[:, None]
    extras = (weights[:, :, None] * triangles).sum(axis=1)
    return replace(problem, points=np.concatenate([extras, problem.points]))


def with_unreferenced() -> Problem:
    """A box as a mesh, with points far outside on no triangle."""
    problem = box(1.0, 2.0, 3.0)
    points = np.concatenate([[[9.0, 9.0, 9.0], [-7.0, 0.0, 0.0]], problem.points])
    triangles = Triangulation(problem.points).simplices.astype(np.int64) + 2
    return replace(problem, points=points, triangles=triangles, center=None)


def with_interior(points: int = 10**6) -> Problem:
    """A dodecahedron with points inside."""
    problem = platonic("dodecahedron")
    inside = np.random.default_rng(0).uniform(-0.9, 0.9, size=(points, 3))
    return replace(problem, points=np.concatenate([inside, problem.points]))
