"""Closed triangle meshes as solids of manifold3d, and back.

Nothing that only looks at a mesh needs this module, so those who do import it late.
"""

from __future__ import annotations

import numpy as np
from manifold3d import Error, Manifold, Mesh64

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats, Integers


def solid(vertices: Floats, triangles: Integers) -> Manifold:
    """A closed triangle mesh as a solid, in double precision.

    Parameters
    ----------
    vertices: (n, 3) in any length unit, each point once.
    triangles: (t, 3) in [0, n), counter-clockwise seen from outside.

    Returns
    -------
    Manifold of positive volume.

    Raises
    ------
    InputError: wrong shapes, indices out of range, not finite, not closed, not oriented, or
        without positive volume.
    """
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3:
        raise InputError(
            "solid: expected vertices of shape (n, 3) and triangles of shape (t, 3), got "
            f"{points.shape} and {corners.shape}; pass one row for each"
        )
    if corners.size and (corners.min() < 0 or corners.max() >= len(points)):
        raise InputError(
            f"solid: expected triangles of vertices 0 to {len(points) - 1}, got indices from "
            f"{corners.min()} to {corners.max()}; number the vertices from 0"
        )
    body = Manifold(Mesh64(points, corners.astype(np.uint64)))
    if body.status() != Error.NoError:
        raise InputError(
            "solid: expected finite vertices and a closed surface in which each edge joins two "
            f"triangles, got {body.status().name} for {len(corners)} triangles; repair the mesh or "
            "merge its duplicate vertices"
        )
    if not body.volume() > 0:
        raise InputError(
            f"solid: expected a positive volume, got {body.volume():g}; if it is negative the "
            "triangles face inward: reverse their corners"
        )
    return body


def mesh_of(body: Manifold) -> tuple[Floats, Integers]:
    """Vertices (n, 3) and triangles (t, 3) of a solid, counter-clockwise seen from outside."""
    mesh = body.to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
    return vertices, np.array(mesh.tri_verts, dtype=np.int64)
