"""Whether the file of a die holds one sound solid, as printers' programs want it."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import connected_parts, doubled_area_vectors, edge_neighbors
from dicedesign.results.printing import FileCheck

__all__ = ["checked_file"]


def checked_file(body: Body) -> FileCheck:
    """The flaws of a file of triangles that was read back, its equal positions joined.

    body: with triangles, at least one.
    """
    points, triangles = body.points, body.triangles
    assert triangles is not None
    neighbors = edge_neighbors(triangles)
    inner = neighbors >= 0
    parts = connected_parts(
        np.arange(len(triangles)).repeat(3)[inner.ravel()], neighbors[inner], len(triangles)
    )
    return FileCheck(
        open_edges=int((~inner).sum()),
        pieces=int(parts.max()) + 1,
        self_intersections=len(intersecting_triangles(points, triangles)),
        flat_triangles=int((~doubled_area_vectors(points, triangles).any(axis=1)).sum()),
        volume_mm3=solid_properties(points, triangles)[0],
    )
