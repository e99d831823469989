"""Closed triangle meshes as solids of manifold3d, and back; bodies of parts of several densities.

Nothing that only looks at a mesh needs this module, so those who do import it late.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from manifold3d import Error, Manifold, Mesh64

from dicedesign.errors import InputError, is_finite_number
from dicedesign.geometry.meshes.body import (
    Body,
    MassProperties,
    body_of,
    make_body,
    solid_triangles,
)
from dicedesign.geometry.triangles import Surface, join_inertia
from dicedesign.runtime.arrays import Floats, Integers


def solid(surface: Surface) -> Manifold:
    """Solid of positive volume that a surface bounds, in double precision.

    surface: each point once. Raises InputError for indices out of range, and for a surface that is
    not finite, not closed, not oriented, or without positive volume.
    """
    points = np.ascontiguousarray(surface.points, dtype=np.float64)
    corners = np.ascontiguousarray(surface.triangles, dtype=np.int64)
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


def mesh_of(body: Manifold) -> Surface:
    """Surface of a solid."""
    mesh = body.to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
    return Surface(vertices, np.array(mesh.tri_verts, dtype=np.int64))


SOURCE = "densities of its parts"

SHARED = 1e-9
"""Share of a solid's volume that may overlap another solid that counts as disjoint."""


def weighted_body(parts: Iterable[tuple[Any, float]]) -> Body:
    """One rigid body of closed meshes with densities.

    Where solids overlap, the later one counts: a steel ball in a wooden box replaces the wood, and
    a part of density 0 is a cavity. Parts outside the others are fixed to them. The hull is the
    hull of all parts.

    Parameters
    ----------
    parts: pairs of a mesh, a `Body` or any object with `vertices` (n, 3) and triangular `faces`
        (t, 3), all in one unit and frame, and a density from 0 on, in any unit.

    Returns
    -------
    Body with the triangles of all parts and, in `mass_properties`, its mass, center and inertia.

    Raises
    ------
    InputError: there are no parts, a mesh is not closed or intersects itself, a density is not a
        number from 0 on, or the mass is 0.
    DegenerateBodyError: as `make_body`.
    """
    bodies, densities = [], []
    for number, (mesh, density) in enumerate(parts):
        body = body_of(mesh, name=f"part {number}")
        if not is_finite_number(density) or density < 0.0:
            raise InputError(
                f"{body.name}: expected a density from 0 on, got {density!r}; 0 is a cavity"
            )
        bodies.append(body)
        densities.append(float(density))
    if not bodies:
        raise InputError("parts: expected at least one mesh with its density, got none; give one")
    corners = np.concatenate([body.points for body in bodies])
    origin, size = corners.mean(axis=0), float(np.ptp(corners, axis=0).max())
    solids = [_solid(body, origin, size) for body in bodies]
    notes, before = [], solids[0]
    for body, part in zip(bodies[1:], solids[1:], strict=True):
        if (before ^ part).volume() <= SHARED * part.volume():
            notes.append(f"{body.name} is not inside the other parts; it counts as fixed to them")
        before += part
    pieces, volume = [], 0.0
    for number, (rest, density) in enumerate(zip(solids, densities, strict=True)):
        for later in solids[number + 1 :]:
            rest -= later
        if density > 0.0 and not rest.is_empty():
            piece = mesh_of(rest)
            volume += piece.volume
            pieces.append((density * piece.volume, piece.centroid, piece.inertia))
    weights, centers, inertias = (
        np.array(column) for column in zip(*(pieces or [(0.0, origin, np.eye(3))]), strict=True)
    )
    with np.errstate(over="ignore"):
        mass = float(weights.sum() * size**3)
    if not 0.0 < mass < np.inf:
        raise InputError(
            f"{bodies[0].name}: expected a finite mass above 0, got {mass:g}; correct the "
            "densities, or give them in another unit"
        )
    center, inertia = join_inertia(weights, centers, inertias)
    properties = MassProperties(
        mass, origin + size * center, size**2 * inertia, SOURCE, volume * size**3
    )
    starts = np.cumsum([0, *(len(body.points) for body in bodies[:-1])])
    of_parts = [
        start + body.triangles
        for start, body in zip(starts, bodies, strict=True)
        if body.triangles is not None
    ]
    single = any(body.single_precision for body in bodies)
    merged = make_body(corners, np.concatenate(of_parts), bodies[0].name, single)
    own_notes = [note for body in bodies for note in body.notes]
    return replace(merged, mass_properties=properties, notes=(*own_notes, *notes))


def _solid(body: Body, origin: Floats, size: float) -> Manifold:
    """A body as a solid, in coordinates in which all parts together are about as large as 1."""
    triangle_arrays = solid_triangles(body)
    if triangle_arrays is None:
        raise InputError(
            f"{body.name}: expected a closed mesh, whose mass is known, got an open one or points; "
            "repair it, for example with `dicedesign repair`"
        )
    triangles: Integers = triangle_arrays[0]
    surface = Surface((body.points - origin) / size, triangles)
    try:
        return solid(surface.reverse() if surface.volume < 0.0 else surface)
    except InputError as error:
        raise InputError(f"{body.name}: {error}") from error
