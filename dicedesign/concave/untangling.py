"""Part the triangles of a filled hull that meet in a few places.

A point of the surface near a corner of the hull is pressed inward while the corner is held. Where
both are a hair apart, this can turn a triangle over. Around such triangles the displacement of the
surface is replaced by the smoothest one with the same values on the rim, points outside the hull
are drawn toward its middle, which turns no triangle of a cap over, and the center of mass is put
back.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import splu

from dicedesign.concave.correspondence import CENTERED, DEPTH
from dicedesign.concave.hull_problem import HeldCorners, center_gradient
from dicedesign.concave.result import Fill
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.optimize.solvers.descent import edge_laplacian
from dicedesign.runtime.arrays import Floats, Integers

ROUNDS = 3
"""Maximum number of rounds, each of which takes in the triangles that still meet."""

RETURNS = 30
"""Maximum number of steps that put the center of mass back; about ten suffice."""


def untangle(
    held: HeldCorners, hull: ConvexHull, center_of_mass: Floats, points: Floats
) -> Fill | None:
    """Points (n, 3) of a surface without triangles that meet, and their mean squared displacement;
    None if that fails.

    held: corners of the hull as points of the original surface. hull: filled by `points` (n, 3),
    some triangles of which meet. center_of_mass: of the uniform solid.
    """
    surface, corners = held.elasticity.surface, held.corners
    triangles, original = surface.triangles, surface.points
    middle = hull.vertices.mean(axis=0)
    room = hull.heights(middle) - DEPTH * surface.diagonal
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    # Each edge belongs to two triangles, once in each direction.
    laplacian = edge_laplacian(tails, heads, len(points)).tocsr()
    gradient = center_gradient(surface.with_points(points))
    responses = held.elasticity.center_responses(gradient).reshape(-1, 9)
    raised = held.hold(responses).reshape(gradient.shape)
    by_force = np.einsum("nab,nac->bc", gradient, raised)

    def draw_in(moved: Floats) -> Floats:
        """Points inside the hull, but for the corners, which are exact."""
        radii = moved - middle
        stretch = (radii @ hull.normals.T / room).max(axis=1)
        inside = middle + radii / np.maximum(stretch, 1.0)[:, None]
        inside[corners] = hull.vertices
        return inside

    loose = np.zeros(len(points), dtype=bool)
    met: Integers = intersecting_triangles(points, triangles)
    for _ in range(ROUNDS):
        loose[triangles[np.unique(met)]] = True
        # Neighbors too, which the Laplacian counts.
        loose |= laplacian @ loose.astype(np.float64) < 0.0
        loose[corners] = False
        free, rim = np.flatnonzero(loose), np.flatnonzero(~loose)
        if len(free) == 0:
            return None
        pulls = -laplacian[free][:, rim] @ (points - original)[rim]
        points = points.copy()
        points[free] = original[free] + splu(laplacian[free][:, free].tocsc()).solve(pulls)
        points = draw_in(points)
        miss, response = center_of_mass - surface.with_points(points).centroid, by_force
        for _ in range(RETURNS):
            if norms(miss) <= CENTERED * surface.diagonal:
                break
            # Where hardly a point is free, nothing moves the center of mass.
            force = np.linalg.lstsq(response, miss)[0]
            points = draw_in(points + raised @ force)
            left = center_of_mass - surface.with_points(points).centroid
            # Broyden's update: points that are drawn in follow the force less.
            response = response + np.outer(miss - left - response @ force, force) / (force @ force)
            miss = left
        else:
            return None
        met = intersecting_triangles(points, triangles)
        if len(met) == 0:
            moved = points - original
            return points, float((moved * moved).sum(-1).mean())
    return None
