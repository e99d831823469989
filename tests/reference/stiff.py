"""Bodies near a change of their rests: nearly flat, nearly coplanar or nearly balanced."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull as Triangulation

from dicedesign.geometry.sphere import norms, unit_vectors
from tests.reference.problem import Problem

CUBE = np.array(list(product([-0.5, 0.5], repeat=3)))

OFF_CENTER = np.array([0.11, 0.07, -0.03])
"""A center of mass in no plane of symmetry of the cube."""

GLANCING_SEED = 3
"""Seed of a random body in which a separatrix ends at the corner that `glancing` opens."""


GRAZING_HEIGHT = 0.14
"""Height of the center of mass over the bottom of `grazing_body`."""

GRAZING_TOP = np.array([[-0.48, 0.41, 1.33], [-0.37, -0.57, 1.41], [-0.92, 1.58, 2.59]])
"""Upper corners of `grazing_body`. With its height and legs, they have about the largest gradient
of 4,000 random bodies."""


def roof(angle: float, *, centered: bool, tolerance: float | None = None) -> Problem:
    """A cube whose upper facet is bent by an angle in radians."""
    points = np.concatenate([CUBE, [[0.0, -0.5, 0.5], [0.0, 0.5, 0.5]]])
    points[:8, 2] -= np.where(points[:8, 2] > 0.0, 0.5 * np.tan(angle / 2.0), 0.0)
    center, rests = (np.zeros(3), 7) if centered else (OFF_CENTER, 6)
    return _without_counts(
        Problem(points, center, coplanar_tolerance=tolerance, rests=rests, facets=7)
    )


def bulging_cube(height: float, tolerance: float | None = None) -> Problem:
    """A cube with a point above its upper facet, off center."""
    points = np.concatenate([CUBE, [[0.05, 0.12, 0.5 + height]]])
    return _without_counts(
        Problem(points, OFF_CENTER, coplanar_tolerance=tolerance, rests=6, facets=9)
    )


def dented_cube(depth: float, tolerance: float | None = None) -> Problem:
    """A cube with one corner below the plane of its upper facet."""
    points = CUBE.copy()
    points[-1, 2] -= depth
    return _without_counts(
        Problem(points, OFF_CENTER, coplanar_tolerance=tolerance, rests=6, facets=7)
    )


def _without_counts(problem: Problem) -> Problem:
    """The problem, with unknown numbers of rests and facets if a coplanar tolerance may hide the
    bend."""
    exact = problem.coplanar_tolerance == 0.0
    return problem if exact else replace(problem, rests=None, facets=None)


def random_body(seed: int, points: int = 14) -> Problem:
    """The hull of normally distributed points, uniform."""
    return Problem(np.random.default_rng(seed).normal(size=(points, 3)))


def hidden_center(depth: float, near: int) -> Problem:
    """A cube with its center of mass at a depth below a facet (near = 1), the facets of an edge (2)
    or the facets of a corner (3)."""
    center = OFF_CENTER.copy()
    center[:near] = 0.5 - depth
    return Problem(CUBE, center)


def off_balance(distance: float, *, corner: bool) -> Problem:
    """A body that overhangs its small bottom, with the center of mass above a point at a distance
    from an edge or a corner of the bottom, positive inside. The saddle at this edge is as far from
    the normal of the bottom."""
    bottom = np.array([[1.0, 1.1], [-1.05, 0.9], [-0.9, -1.0], [1.1, -0.95]])
    points = np.concatenate(
        [np.column_stack([scale * bottom, np.full(4, z)]) for scale, z in ((1.0, 0.0), (2.0, 2.0))]
    )
    along = unit_vectors(bottom[1] - bottom[0])
    inward = np.array([-along[1], along[0]])
    foot = bottom[0] + distance * (inward + (0.3 * along if corner else 0.0))
    if not corner:
        foot += 0.45 * (bottom[1] - bottom[0])
    return Problem(points, np.array([*foot, 0.9]))


def glancing(growth: float) -> Problem:
    """A random body in which a separatrix leaves a cell where the distance from the center hardly
    grows: r_p . v = growth |r_p| |v| for the crossed edge. Without this edge, p is a maximum."""
    points = random_body(GLANCING_SEED).points
    hull = Triangulation(points)
    center = points[hull.vertices].mean(axis=0)
    tail = hull.simplices[:, [0, 1, 2, 1, 2, 0]].ravel()
    head = hull.simplices[:, [1, 2, 0, 0, 1, 2]].ravel()
    r, v = points[tail] - center, points[head] - points[tail]
    v = unit_vectors(v)
    rise = (r * v).sum(-1)
    opened = np.isin(tail, tail[rise >= 0.0], invert=True)
    edge = int(np.argmax(np.where(opened, rise, -np.inf)))
    distance = float(norms(r[edge]))
    return Problem(points, center + v[edge] * (rise[edge] - growth * distance))


def grazing_body(growth: float, offset: float) -> Problem:
    """A body in which a separatrix crosses an arc where rho = r_p . v / (|r_p| |v|) is a given
    growth. The distance of the saddle from the normal of the bottom is the offset times its height,
    and alpha = -u . v is about this distance. The gradient grows like 1 / rho only if alpha
    vanishes too.

    The bottom is a triangle with a nearly right angle at p, and the foot of the center of mass is
    at `offset` from the middle of one leg: the saddle's line enters the cell of p and leaves it
    across the other leg's arc.
    """
    center = np.array([0.5, offset, GRAZING_HEIGHT])
    reach = np.hypot(0.5, offset)
    tilt = np.arctan2(offset, 0.5)
    tilt += np.arcsin(growth * np.hypot(reach, GRAZING_HEIGHT) / reach)
    leg = 1.3 * np.array([-np.sin(tilt), np.cos(tilt), 0.0])
    bottom = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], leg])
    return Problem(np.concatenate([bottom, GRAZING_TOP]), center)


def opposed_corner(distance: float) -> Problem:
    """A body in which the line from a corner through the center of mass is the normal of a facet,
    and the corner is on the border of the basin of this facet; for a distance other than 0, the
    center of mass is about this distance away."""
    points = [
        [-1, 2, 2],
        [-2, 1, 1],
        [0, -2, -2],
        [-2, 2, -1],
        [1, 1, 2],
        [0, -1, 1],
        [-1, -2, 1],
        [1, -2, -2],
    ]
    center = np.array([0.5, 0.0, 0.5]) - distance * np.array([0.73, 0.58, -0.36])
    return Problem(np.array(points, dtype=np.float64), center)


def place(problem: Problem, size: float, distance: float) -> Problem:
    """A problem scaled by a size, and moved away from the origin by a multiple of its size."""
    shift = size * distance * np.array([0.6, -0.48, 0.64])
    center = None if problem.center is None else problem.center * size + shift
    return replace(problem, points=problem.points * size + shift, center=center, symmetries=())
