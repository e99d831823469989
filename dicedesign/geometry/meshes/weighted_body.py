"""A body of parts of several densities."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body, body_of, make_body
from dicedesign.geometry.meshes.center_of_mass import solid_triangles
from dicedesign.geometry.meshes.mass_properties import summed
from dicedesign.geometry.solid import second_moments, solid_properties
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.checks import is_finite_number

if TYPE_CHECKING:
    from manifold3d import Manifold


SOURCE: Final = "densities of its parts"

SHARED: Final = 1e-9
"""Part of a solid's volume that it may share with another and still be beside it."""


def weighted_body(parts: Iterable[tuple[Any, float]]) -> Body:
    """One rigid body of closed meshes with densities.

    Where solids overlap, the later one is: a steel ball in a wooden box takes the wood's place, and
    a part of density 0 is a cavity. What lies beside the others is fixed to them. The hull is that
    of all of them.

    Parameters
    ----------
    parts: pairs of a mesh, a `Body` or any object with `vertices` (n, 3) and triangular `faces`
        (t, 3), all in one unit and frame, and a density from 0 on, in any unit.

    Returns
    -------
    Body with the triangles of all parts and, in `mass_properties`, its mass, center and inertia.

    Raises
    ------
    InputError: there are no parts, a mesh is not closed or meets itself, a density is no number
        from 0 on, or the mass is 0.
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
    notes = list(_beside(bodies, solids))
    masses, centers, spreads = [], [], []
    for number, (rest, density) in enumerate(zip(solids, densities, strict=True)):
        for later in solids[number + 1 :]:
            rest -= later
        if density > 0.0 and not rest.is_empty():
            volume, center, spread = _moments(rest)
            masses.append(density * volume * size**3)
            centers.append(origin + size * center)
            spreads.append(size**2 * spread)
    if sum(masses) <= 0.0:
        raise InputError(
            f"{bodies[0].name}: expected a mass above 0, got parts that leave none; correct the "
            "densities"
        )
    found = summed(masses, np.stack(centers), np.stack(spreads), SOURCE)
    starts = np.cumsum([0, *(len(body.points) for body in bodies[:-1])])
    triangles = [
        start + body.triangles
        for start, body in zip(starts, bodies, strict=True)
        if body.triangles is not None
    ]
    single = any(body.single_precision for body in bodies)
    made = make_body(corners, np.concatenate(triangles), bodies[0].name, single)
    own_notes = [note for body in bodies for note in body.notes]
    return replace(made, mass_properties=found, notes=(*own_notes, *notes))


def _solid(body: Body, origin: Floats, size: float) -> Manifold:
    """A body as a solid, in coordinates in which all parts together are about as large as 1."""
    # Other meshes do without this library.
    from dicedesign.geometry.manifold import solid

    found = solid_triangles(body)
    if found is None:
        raise InputError(
            f"{body.name}: expected a closed mesh, whose mass is known, got an open one or points; "
            "repair it, for example with `dicedesign repair`"
        )
    triangles: Integers = found[0]
    points = (body.points - origin) / size
    if solid_properties(points, triangles)[0] < 0.0:
        triangles = triangles[:, ::-1]
    try:
        return solid(points, triangles)
    except InputError as error:
        raise InputError(f"{body.name}: {error}") from error


def _moments(solid: Manifold) -> tuple[float, Floats, Floats]:
    """Volume, center (3,) and spread (3, 3) of a solid, see `summed`."""
    from dicedesign.geometry.manifold import mesh_of

    points, triangles = mesh_of(solid)
    volume, center = solid_properties(points, triangles)
    moments, own = second_moments(points - center, triangles, np)
    return volume, center, np.asarray(moments / own)


def _beside(bodies: list[Body], solids: list[Manifold]) -> Iterable[str]:
    """Notes on parts after the first that share nothing with those before them."""
    before = solids[0]
    for body, solid in zip(bodies[1:], solids[1:], strict=True):
        if (before ^ solid).volume() <= SHARED * solid.volume():
            yield f"{body.name} is not inside the other parts; it counts as fixed to them"
        before += solid
