"""Join the parts of a solid that overlap each other."""

from __future__ import annotations

from typing import Final

from manifold3d import Error, Manifold, OpType

from dicedesign.concave.self_intersections import intersecting_triangles, intersection_groups
from dicedesign.geometry.solid import mesh_of

__all__ = ["with_overlaps_joined"]

_MARGINS: Final = (0.005, 0.02)
"""How far the box that is cut out reaches beyond the triangles that meet, relative to the diagonal
of the body's box, tried in turn."""


def with_overlaps_joined(body: Manifold, diagonal: float) -> Manifold:
    """A solid without the places where two parts of it overlap and can be joined.

    No boolean operation of a solid with itself joins its overlapping parts: the result is a
    polynomial of the winding number with integer coefficients, which is even where that is 2. So a
    box around the place is cut out. What is inside it falls into the parts that overlap, where they
    hang together outside it only, and their union with the rest is the solid without the overlap.
    A surface that is pushed through itself from the inside stays as it is.

    diagonal: of the body's box. Returns the solid, the same if nothing was joined.
    """
    points, triangles = mesh_of(body)
    for group in intersection_groups(triangles, intersecting_triangles(points, triangles)):
        corners = points[triangles[group]].reshape(-1, 3)
        for margin in _MARGINS:
            lower = corners.min(axis=0) - margin * diagonal
            upper = corners.max(axis=0) + margin * diagonal
            box = Manifold.cube(tuple(upper - lower)).translate(tuple(lower))
            joined = _joined(body, box)
            if joined is not None:
                body = joined
                break
    return body


def _joined(body: Manifold, box: Manifold) -> Manifold | None:
    """The body with the parts that it has inside a box joined; None if that is of no use."""
    parts = (body ^ box).decompose()
    if len(parts) < 2:
        return None
    inside = Manifold.batch_boolean(parts, OpType.Add)
    if len(intersecting_triangles(*mesh_of(inside))) > 0:
        return None
    joined = body - box + inside
    return joined if joined.status() == Error.NoError and len(joined.decompose()) == 1 else None
