"""A deformed surface as a solid that can be printed."""

from __future__ import annotations

import numpy as np
from manifold3d import Error, Manifold
from numpy.typing import NDArray

from dicedesign.concave.self_intersections import intersecting_triangles
from dicedesign.concave.surface import Surface
from dicedesign.errors import InputError
from dicedesign.fabricate.overlaps import with_overlaps_joined
from dicedesign.geometry.solid import mesh_of, solid
from dicedesign.tolerances import PRINT_TOLERANCE

__all__ = ["printable_solid"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def printable_solid(surface: Surface) -> tuple[Floats, Integers, tuple[str, ...]]:
    """The solid that a surface bounds, cleaned by manifold3d.

    Edges and slivers thinner than `PRINT_TOLERANCE` are collapsed, and points in the middle of flat
    parts with them, so that no point of the surface moves by more. Parts that overlap are joined
    where `with_overlaps_joined` can.

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
    joined = with_overlaps_joined(body, surface.diagonal)
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
    """What joining and cleaning changed, in words."""
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
