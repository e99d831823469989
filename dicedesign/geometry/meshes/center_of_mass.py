"""The center of mass of a body, and the triangles that bound its solid."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.orientation import closed_triangles, oriented_shells
from dicedesign.geometry.solid import solid_properties
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import VOLUME_TOLERANCE


def resolve_center_of_mass(
    body: Body,
    hull_centroid: Floats,
    request: Literal["hull"] | ArrayLike | None = None,
) -> tuple[Floats, str, tuple[str, ...]]:
    """Center of mass of a body, where it comes from, and what had to be assumed.

    Parameters
    ----------
    body: its triangles, if any, need not be closed or consistently wound.
    hull_centroid: (3,) centroid of the body's convex hull, taken for a point cloud, an open mesh
        or on request.
    request: "hull", or (3,) numbers that are taken as they are, in the unit of the points; None
        decides by the densities of the body, or else by the mesh.

    Returns
    -------
    (3,) the center in the unit of the points, not checked to lie inside the hull; its source
    "uniform solid", "uniform solid hull", "given" or that of `MassProperties`; and what was
    assumed or re-oriented, one sentence each.

    Raises
    ------
    InputError: the request is neither "hull" nor three finite numbers.
    DegenerateBodyError: the mesh is closed and encloses no volume.
    """
    if isinstance(request, str):
        if request != "hull":
            raise _bad_request(request)
        return hull_centroid, "uniform solid hull", ()
    if request is not None:
        return _given(request), "given", ()
    if body.mass_properties is not None:
        return body.mass_properties.center_of_mass, body.mass_properties.source, ()
    if body.triangles is None:
        return hull_centroid, "uniform solid hull", ("the body has no triangles",)

    solid = solid_triangles(body)
    if solid is None:
        return hull_centroid, "uniform solid hull", ("the mesh is not closed",)
    triangles, notes = solid
    volume, centroid = solid_properties(body.points, triangles)
    extent = float(np.ptp(body.points, axis=0).max())
    if abs(volume) <= VOLUME_TOLERANCE * extent**3:
        raise DegenerateBodyError(
            f"{body.name}: expected a closed mesh that encloses a volume, got {volume:.3g} at an "
            f"extent of {extent:.3g}; give a center of mass with --com x,y,z or take that of the "
            "convex hull with --com hull"
        )
    if volume < 0 and not notes:
        notes = ("the mesh is oriented inward and was taken as a solid all the same",)
    return centroid, "uniform solid", notes


def solid_triangles(body: Body) -> tuple[Integers, tuple[str, ...]] | None:
    """The triangles (t, 3) that bound a body's solid, wound alike, and what had to be done for it,
    one sentence each; None for a point cloud and an open mesh. All may point inward."""
    closed = None if body.triangles is None else closed_triangles(body.triangles)
    if closed is None:
        return None
    triangles, notes = closed
    triangles, turned = oriented_shells(body.points, triangles)
    if turned > 0:
        notes += (f"turned {turned} shells that lie beside others and were oriented against them",)
    return triangles, notes


def _given(request: ArrayLike) -> Floats:
    try:
        center = np.asarray(request, dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise _bad_request(request) from error
    if center.shape != (3,) or not np.isfinite(center).all():
        raise _bad_request(request)
    return center


def _bad_request(request: object) -> InputError:
    return InputError(
        f'center of mass: expected "hull" or three finite numbers x,y,z, got {request!r}; '
        "give one of them or leave it out"
    )
