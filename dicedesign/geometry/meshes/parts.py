"""Connected parts of a mesh: loose ones that decide its hull, and the largest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors, surface_of, winding_number
from dicedesign.runtime.arrays import Integers

LOOSE_SHARE = 1e-3
"""Share of the area below which a part of a mesh is loose."""

MAX_DUST = 0.1
"""Share of the area up to which all loose parts together are less than the body."""


def loose_part_notes(body: Body, corners: Integers) -> tuple[str, ...]:
    """A sentence on loose parts that have corners of the convex hull to themselves, if there are
    any; corners: (v,) points of the body on the hull."""
    shells = body.shells
    if body.triangles is None or not shells.any():
        return ()
    areas = _areas(body)
    shares = areas / areas.sum()
    loose = shares < LOOSE_SHARE
    if shares[loose].sum() > MAX_DUST:
        return ()
    is_corner = np.zeros(len(body.points), dtype=bool)
    is_corner[corners] = True
    is_corner[body.triangles[~loose[shells]]] = False
    decides = is_corner[body.triangles].any(axis=1)
    parts = np.unique(shells[decides])
    if len(parts) == 0:
        return ()
    place = body.points[body.triangles[decides][0]].mean(axis=0)
    near = ", ".join(f"{x:.4g}" for x in place)
    return (
        f"{len(parts)} loose parts of {100.0 * shares[parts].sum():.1g} % of the area decide the "
        f"convex hull, one near ({near}); if they are no part of the body, leave them out with "
        "dicedesign rest --largest-part",
    )


def largest_part(body: Body) -> Body:
    """The connected part of a mesh with the largest area and all within it, such as cavities.

    Raises InputError: the body is a point cloud.
    """
    if body.triangles is None:
        raise InputError(
            f"{body.name}: expected a mesh whose largest part is kept, got points; leave "
            "--largest-part out"
        )
    shells, areas = body.shells, _areas(body)
    corners = body.points[body.triangles]
    largest = corners[shells == areas.argmax()]
    low, high = largest.min(axis=(0, 1)), largest.max(axis=(0, 1))
    first = np.unique(shells, return_index=True)[1]
    middles = corners[first].mean(axis=1)
    kept = ((middles > low) & (middles < high)).all(axis=1)
    for shell in np.flatnonzero(kept):
        kept[shell] = abs(winding_number(middles[shell], largest)) > 0.5
    kept[areas.argmax()] = True
    if kept.all():
        return body
    surface = surface_of(body.points, body.triangles[kept[shells]])
    note = f"kept the largest of {len(areas)} parts, left {np.count_nonzero(~kept)} out"
    return replace(
        body, points=surface.points, triangles=surface.triangles, notes=(*body.notes, note)
    )


def _areas(body: Body) -> NDArray[Any]:
    """(s,) doubled areas of the parts of a mesh."""
    assert body.triangles is not None
    vectors = doubled_area_vectors(body.points, body.triangles)
    return np.bincount(body.shells, norms(vectors))
