"""Bodies with few rests or one, large hulls, and bodies with points that are no corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull as Triangulation
from scipy.spatial import HalfspaceIntersection, QhullError

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.runtime.arrays import Floats, Integers
from tests.reference.problem import Problem

ANTIPODE_SEEDS = (5, 102, 255, 278, 463, 482, 623, 874)
"""Seeds of `lopsided_needle` for which a basin contains the antipode of its own normal."""


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


OFFSET = 100_000
"""The half-spaces of `HALF_SPACES` are a x + b y + c z <= OFFSET."""

HALF_SPACES = {
    18: """
           0  -99969   -2482
      -38225  -80282    1911
       41727  -75112   -6074
      -58408  -58156    4589
       61156  -48726   -7522
      -68711  -35556    6337
      -71657  -13398    7687
       68576  -22269   -8297
      -68484    7094    8226
       66644    2364   -9067
      -60325   25017    3229
       57456   23350   -6503
      -47301   37672   11043
      -31676   47153   11123
       42959   37718    3487
       40813   38825   -9818
       27101   45860    6112
      -18375   49732   -4798
    """,
    14: """
           0  -99983   -1832
       43817  -73120   -4125
      -44757  -71364    1541
       63222  -45346   -4854
      -63632  -41894    3287
       69919  -18093   -4816
      -68697  -12993    4249
       66826    7318   -4589
      -62931   13208    3358
       55832   28427   -1814
      -48321   33474    5385
       38571   43293   -3525
      -31384   45027     646
       20892   50175    1843
    """,
}
"""Rows a, b, c of the polyhedra of `unistable` by their number of facets. The
first is the rest, the others rise in distance from the centroid.

Derived here: a facet does not hold the body if the foot of the centroid on its plane lies beyond
the plane of another facet. Its lead is the largest such excess, over that plane's distance from the
centroid. Linear programs, each a small step in a, b, c that keeps the centroid, raised the least
lead of all facets but one; they began with `conway_guy`, and again after leaving out a facet. The
least lead is 1.4 % with 18 facets and 0.5 % with 14, at 13 and 44 times as long as wide.
"""


def conway_guy(sides: int = 17, slope: float = 12.0) -> Problem:
    """A uniform body that rests on one of its 19 facets only.

    The cross-section is a double spiral: radius cos^k(b) at the angle k b from the top, so that the
    point nearest to the origin is the lower end of each side. Slanted ends put the center of mass
    below the origin, and lean so far that the body tips over them.
    Source: J. H. Conway and R. K. Guy, Stability of polyhedra, SIAM Review 11 (1969) 78-82.
    """
    step = 2.0 * np.pi / (sides + 1)
    k = np.arange((sides + 1) // 2)
    half = np.cos(step) ** k[:, None] * np.column_stack([np.sin(k * step), np.cos(k * step)])
    outline = np.concatenate([half, half[:0:-1] * [-1.0, 1.0]])
    reach = slope + 1.1 / slope - slope * outline[:, 1]
    ends = [np.column_stack([outline, side * reach]) for side in (-1.0, 1.0)]
    return Problem(np.concatenate(ends), shares=np.ones(1), rests=1)


def unistable(facets: int) -> Problem:
    """A uniform body without symmetry that rests on one of its few facets only.

    With 14 facets they make two flights of stairs: the body tips from each onto the next but one
    in `HALF_SPACES`. The first of 18 and of 14 facets are by A. Bezdek, On stability of polyhedra
    (2011), and A. Reshetov, A unistable polyhedron with 14 faces, International Journal of
    Computational Geometry and Applications 24 (2014), doi 10.1142/S0218195914500022. These are
    others of their kind.
    """
    normals = np.array(HALF_SPACES[facets].split(), dtype=np.float64).reshape(-1, 3)
    planes = np.column_stack([normals, np.full(facets, -OFFSET)])
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections
    return Problem(corners, shares=np.ones(1), rests=1)


def with_repeats(problem: Problem, seed: int) -> Problem:
    """All points, some of them repeated up to three times, in random order."""
    rng = np.random.default_rng(seed)
    counts = np.maximum(rng.integers(-2, 4, size=len(problem.points)), 0) + 1
    order = rng.permutation(np.repeat(np.arange(len(problem.points)), counts))
    return replace(problem, points=problem.points[order])


def with_extras(problem: Problem, seed: int, count: int, on: str) -> Problem:
    """Further points on facets or edges of the hull, to within rounding, or "inside" of it."""
    rng = np.random.default_rng(seed)
    triangles = hull_triangles(problem.points)
    if triangles is None:
        return problem
    corners = problem.points[triangles[rng.integers(len(triangles), size=count)]]
    weights = rng.dirichlet(np.ones(3), size=count)
    if on == "edge":
        weights[:, 2] = 0.0
        weights /= weights.sum(axis=1)[:, None]
    extras = (weights[:, :, None] * corners).sum(axis=1)
    if on == "inside":
        middle = problem.points[np.unique(triangles)].mean(axis=0)
        extras = middle + rng.uniform(0.0, 0.98, size=(count, 1)) * (extras - middle)
    order = rng.permutation(len(problem.points) + count)
    return replace(problem, points=np.concatenate([problem.points, extras])[order])


def hull_triangles(points: Floats) -> Integers | None:
    """Triangles of the hull, in a fixed order, or None where points are too flat for Qhull."""
    local = points - points.mean(axis=0)
    try:
        simplices = Triangulation(local / max(float(np.abs(local).max()), 1e-300)).simplices
    except (QhullError, ValueError):
        return None
    return np.unique(np.sort(simplices, axis=1), axis=0).astype(np.int64)
