"""Whether the file of a die holds one sound solid, as printers' programs want it."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import connected_parts, doubled_area_vectors, edge_neighbors
from dicedesign.results.printability import FileCheck

__all__ = ["checked_file"]

THIN: Final = 1e-4
"""Width in mm below which a triangle is a line to any printer. Single precision may fold it onto
its neighbors, and what it meets is not counted."""


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
    meeting = intersecting_triangles(points, triangles)
    corners = points[triangles]
    longest = norms(corners - np.roll(corners, 1, axis=1)).max(axis=1)
    widths = norms(doubled_area_vectors(points, triangles)) / longest
    volumes = [
        solid_properties(points, triangles[parts == part])[0] for part in range(parts.max() + 1)
    ]
    return FileCheck(
        open_edges=int((~inner).sum()),
        pieces=sum(volume > 0.0 for volume in volumes),
        cavities=sum(volume <= 0.0 for volume in volumes),
        self_intersections=int((widths[meeting] >= THIN).all(axis=1).sum()),
        flat_triangles=int((widths == 0.0).sum()),
        volume_mm3=sum(volumes),
    )
