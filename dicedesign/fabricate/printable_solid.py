"""A deformed surface as a solid that can be printed: overlaps joined, slivers taken out."""

from __future__ import annotations

from typing import Final

from manifold3d import Error, Manifold, OpType

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.surfaces.self_intersections import (
    intersecting_triangles,
    intersection_groups,
)
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import PRINT_TOLERANCE

MARGINS: Final = (0.005, 0.02)
"""Distances that the box that is cut out reaches beyond the triangles that meet, relative to the
diagonal of the body's box, tried in turn."""


def printable_solid(surface: Surface) -> tuple[Floats, Integers, tuple[str, ...]]:
    """The solid that a surface bounds, cleaned by manifold3d.

    Edges and slivers thinner than `PRINT_TOLERANCE` are collapsed, and points in the middle of flat
    parts with them, so that no point of the surface moves by more. Parts that overlap are joined
    where `_with_overlaps_joined` can.

    Returns
    -------
    (n, 3) points in the unit of the surface and (t, 3) triangles, counter-clockwise seen from
    outside, and what was changed and what is left, one sentence each; no sentence for a surface
    that came through as it was.

    Raises
    ------
    InputError: the surface bounds no solid of positive volume, or falls apart when it is cleaned.
    """
    body = solid(surface.points, surface.triangles)
    joined = _with_overlaps_joined(body, surface.diagonal)
    cleaned = joined.simplify(PRINT_TOLERANCE * surface.diagonal)
    pieces = len(cleaned.decompose()) if cleaned.status() == Error.NoError else 0
    if pieces != 1 or not cleaned.volume() > 0.0:
        raise InputError(
            f"printable solid: expected one piece of positive volume, got {pieces} of "
            f"{cleaned.volume():.3g} from {body.num_tri()} triangles; remesh the surface or deform "
            "it less"
        )
    points, triangles = mesh_of(cleaned)
    return points, triangles, (*_changes(body, joined, cleaned), *_left(points, triangles))


def _changes(body: Manifold, joined: Manifold, cleaned: Manifold) -> tuple[str, ...]:
    """Changes by joining and cleaning, in words."""
    notes = []
    if joined is not body:
        notes.append(
            f"parts that overlap were joined: {joined.num_tri()} triangles from {body.num_tri()}, "
            f"{_volume_change(body, joined)}, {body.genus()} handles before and "
            f"{joined.genus()} after"
        )
    if cleaned.num_tri() != joined.num_tri():
        notes.append(
            f"edges and slivers were taken out: {cleaned.num_tri()} triangles are left of "
            f"{joined.num_tri()}, {_volume_change(joined, cleaned)}"
        )
    if cleaned.genus() != joined.genus():
        notes.append(f"handles were closed: {cleaned.genus()} are left of {joined.genus()}")
    return tuple(notes)


def _volume_change(before: Manifold, after: Manifold) -> str:
    return f"volume {100.0 * (after.volume() / before.volume() - 1.0):+.2g} %"


def _left(points: Floats, triangles: Integers) -> tuple[str, ...]:
    pairs = intersecting_triangles(points, triangles)
    if len(pairs) == 0:
        return ()
    return (
        f"the solid still meets itself in {len(pairs)} pairs of triangles: look at it in the "
        "slicer before printing",
    )


def _with_overlaps_joined(body: Manifold, diagonal: float) -> Manifold:
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
        for margin in MARGINS:
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
