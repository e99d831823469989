"""The convex hull of a mesh file."""

from __future__ import annotations

import numpy as np

from dicedesign.design.starts.start import Start, normalised_start
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats

__all__ = ["mesh_start"]


def mesh_start(body: Body, outcomes: int, center_of_mass: Floats | None = None) -> Start:
    """The convex hull of a body, with its `outcomes` most probable rests carrying the outcomes.

    Own coordinates: those of the body.

    Parameters
    ----------
    body: any mesh or point cloud.
    outcomes: how many rests carry an outcome.
    center_of_mass: (3,) in the body's unit, or None for that of the uniform solid hull.

    Raises
    ------
    InputError: the hull has fewer rests than outcomes.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    """
    poses = rest_poses(body, "hull" if center_of_mass is None else center_of_mass)
    if len(poses.normals) < outcomes:
        raise InputError(
            f"start.mesh: expected a body with at least {outcomes} rests, one for each outcome, "
            f"got {len(poses.normals)} in {body.name}; take another start"
        )
    return normalised_start(_exact_corners(poses.hull), poses.normals[:outcomes], poses.notes)


def _exact_corners(hull: ConvexHull) -> Floats:
    """(n, 3) corners where the planes of a hull's facets meet. Rounded coordinates scatter about
    the plane of a merged facet; these lie on it, so that it stays one facet."""
    start = hull.facet_start[:-1]
    offsets = ((hull.vertices[hull.tail] - hull.centroid) * hull.normals[hull.facet]).sum(-1)
    heights = np.add.reduceat(offsets, start) / np.diff(hull.facet_start)
    return polyhedron_corners(hull.normals, heights) + hull.centroid
