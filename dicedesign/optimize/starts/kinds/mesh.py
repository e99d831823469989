"""The convex hull of a mesh file, or its surface where the die is concave."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError
from dicedesign.optimize.starts.start import (
    STARTS,
    Start,
    StartKind,
    StartSurface,
    Task,
    normalised_start,
)
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.registry import STRICT

if TYPE_CHECKING:
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.meshes.body import Body

__all__ = ["MeshOptions", "mesh_start"]


@dataclass(frozen=True)
class MeshOptions:
    """`start.mesh`.

    Attributes
    ----------
    path: of the file, relative to the recipe's folder, or to the working directory in a change from
        the command line.
    repair: of a mesh that is open, no manifold, of several bodies or meets itself, take the closed
        surface of the largest solid that it encloses; for method concave.
    """

    __pydantic_config__ = STRICT

    path: str
    repair: bool = False


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
    from dicedesign.rest.poses import rest_poses

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
    from dicedesign.geometry.hulls.halfspaces import polyhedron_corners

    start = hull.facet_start[:-1]
    offsets = ((hull.vertices[hull.tail] - hull.centroid) * hull.normals[hull.facet]).sum(-1)
    heights = np.add.reduceat(offsets, start) / np.diff(hull.facet_start)
    return polyhedron_corners(hull.normals, heights) + hull.centroid


def _made(options: MeshOptions, task: Task) -> Start:
    from dicedesign.geometry.meshes.reading import read_body

    if options.repair:
        raise InputError(
            "start.mesh.repair: expected method concave, which keeps the mesh, got one that takes "
            "its convex hull, with nothing to repair; leave it out"
        )
    return mesh_start(read_body(Path(options.path)), task.outcomes, task.center_of_mass)


def _surface(options: MeshOptions, points: int) -> StartSurface:
    from dicedesign.geometry.meshes.reading import read_body
    from dicedesign.geometry.repair.repair import input_surface

    return StartSurface(
        *input_surface(read_body(Path(options.path)), points, repair=options.repair)
    )


STARTS.register(
    StartKind(
        name="mesh",
        line="the convex hull of a mesh file, its most probable rests for the outcomes; or its "
        "surface, with method concave",
        rank=3,
        options=MeshOptions,
        make=_made,
        surface=_surface,
    )
)
