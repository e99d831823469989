"""Filled hulls, some triangles of which are turned over, without triangles that meet."""

from __future__ import annotations

import numpy as np
import pytest
from common.bumpy import bumpy_sphere, nearby_hull, unit

from dicedesign.concave.correspondence import fill_by_correspondence
from dicedesign.concave.hull_problem import Elasticity, HeldCorners
from dicedesign.concave.untangling import untangle
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.runtime.arrays import Floats


@pytest.mark.parametrize("seed", range(3))
def test_triangles_that_are_turned_over_are_parted(seed: int) -> None:
    """Pairs of neighbors that have changed their places get free places without leaving the hull or
    moving its corners or the center of mass."""
    surface = unit(bumpy_sphere(3))
    hull = nearby_hull(surface, 0.02, seed)
    held = HeldCorners(Elasticity(surface), convex_hull(surface.points).source[hull.source])
    fill = fill_by_correspondence(held, hull, surface.centroid, lambda energy: None)
    assert fill is not None
    tangled: Floats = fill[0].copy()
    is_free = ~np.isin(surface.triangles, held.corners).any(axis=1)
    for triangle in surface.triangles[is_free][[5 * seed, -1 - seed]]:
        tangled[triangle[:2]] = tangled[triangle[1::-1]]
    assert len(intersecting_triangles(tangled, surface.triangles)) > 0
    parted = untangle(held, hull, surface.centroid, tangled)
    assert parted is not None
    points, _ = parted
    assert len(intersecting_triangles(points, surface.triangles)) == 0
    np.testing.assert_array_equal(points[held.corners], hull.vertices)
    others = np.delete(np.arange(len(points)), held.corners)
    slacks = hull.heights(np.zeros(3)) - points[others] @ hull.normals.T
    assert slacks.min() > 1e-6 * surface.diagonal
    miss = surface.with_points(points).centroid - surface.centroid
    assert np.linalg.norm(miss) < 1e-12 * surface.diagonal
    # What is far from the places stays there.
    assert np.median(np.linalg.norm(points - fill[0], axis=1)) < 1e-3
