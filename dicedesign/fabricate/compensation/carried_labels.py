"""Labels that go along with their facets when a shape changes a little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dicedesign.fabricate.label_layout import Placement
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import centroid
from dicedesign.geometry.sphere import rotation_between
from dicedesign.runtime.arrays import Floats

__all__ = ["carried"]


def carried(
    placements: Sequence[Placement], before: ConvexHull, after: ConvexHull, moved_normals: Floats
) -> tuple[Placement, ...]:
    """Labels on the facets of one hull, moved onto those of another that is nearly the same.

    A label keeps its size and its place from the centroid of its facet, and turns no more than the
    facet does: so a small change of the shape is a small change of what the labels take away.

    moved_normals: (m, 3) unit normals that the facets of the first hull have in the second one. The
        nearest of the second hull's may be another facet's, where two lie almost in one plane.
    """
    return tuple(_moved(placement, before, after, moved_normals) for placement in placements)


def _moved(
    placement: Placement, before: ConvexHull, after: ConvexHull, moved_normals: Floats
) -> Placement:
    frame = placement.frame.copy()
    old = int(np.argmax(before.normals @ frame[:3, 2]))
    new = int(np.argmax(after.normals @ moved_normals[old]))
    turn = rotation_between(before.normals[old], after.normals[new])
    from_centroid = frame[:3, 3] - _facet_centroid(before, old, frame)
    frame[:3, :3] = turn @ frame[:3, :3]
    frame[:3, 3] = _facet_centroid(after, new, frame) + turn @ from_centroid
    return replace(placement, frame=frame)


def _facet_centroid(hull: ConvexHull, facet: int, frame: Floats) -> Floats:
    """(3,) of the area of a facet, parallel to the plane of x and y of a frame (4, 4)."""
    corners = hull.polygon(facet)
    origin = corners.mean(axis=0)
    flat = centroid((corners - origin) @ frame[:3, :2])
    middle: Floats = origin + frame[:3, :2] @ flat
    return middle
