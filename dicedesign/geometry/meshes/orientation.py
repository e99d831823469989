"""The solid that a mesh's triangles bound: wound alike, each shell like those around it, and where
its center of mass is."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.triangles import (
    connected_parts,
    doubled_area_vectors,
    edge_keys,
    is_closed,
    solid_properties,
    winding_number,
)
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index
from dicedesign.tolerances import VOLUME_TOLERANCE

_CLEAR: Final = 0.25
"""A winding number that is nearer than this to an integer is that integer; for a point on a flat
part of the surface it is a half."""

_OPEN: Final = 0.1
"""Area of the flat cover of a patch's holes, over its own, up to which it has an inside."""


_TWO_SIDED: Final = 0.9
"""Part of its triangles that a surface with two sides has from both, at least."""


def closed_triangles(triangles: Integers) -> tuple[Integers, tuple[str, ...]] | None:
    """The same triangles (t, 3) as a closed, consistently oriented surface, and what had to be
    reversed for it, in a sentence; None where they do not close."""
    if is_closed(triangles):
        return triangles, ()
    oriented = consistent_winding(triangles)
    if oriented is None:
        return None
    count = np.count_nonzero((oriented != triangles).any(axis=1))
    return oriented, (f"reversed {count} triangles that were wound against their neighbors",)


def consistent_winding(triangles: Integers) -> Integers | None:
    """Reverse as few triangles as needed for a closed, consistently oriented surface.

    Each triangle stands twice in a graph, once kept and once reversed, and two triangles that
    share an edge link the copies that agree. An orientable part of the surface falls into two
    components, one the reverse of the other, and the one that keeps more triangles is taken.

    triangles: (t, 3) vertex indices, nonnegative. Returns the same triangles in the same order,
    some reversed, or None when no choice closes the surface, because it has a boundary or is
    one-sided.
    """
    if len(triangles) == 0:
        return None
    oriented, _ = _agreeing(triangles)
    return oriented if is_closed(oriented) else None


def outward_patches(points: Floats, triangles: Integers) -> Integers:
    """Triangles (t, 3) of any kind, wound alike and outward as far as they say what that is.

    Those that hang together by edges of two triangles are a patch. In each as few as needed are
    reversed, and all of one that is closed, or nearly, and inward: cavities and bodies alike.

    points: (n, 3). Returns the same triangles in the same order, some reversed.
    """
    oriented, patch = _agreeing(triangles)
    vectors = doubled_area_vectors(points, oriented)
    count = int(patch.max()) + 1
    covers = np.linalg.norm(sums_by_index(patch, vectors, count), axis=1)
    areas = np.bincount(patch, np.linalg.norm(vectors, axis=1), count)
    middles = points[oriented].mean(axis=1)
    sizes = np.bincount(patch, minlength=count).clip(1)
    arms = middles - (sums_by_index(patch, middles, count) / sizes[:, None])[patch]
    volumes = np.bincount(patch, (arms * vectors).sum(axis=1), count)
    inward = (volumes < 0.0) & (covers <= _OPEN * areas)
    return np.where(inward[patch][:, None], oriented[:, ::-1], oriented)


def distinct_triangles(triangles: Integers) -> Integers:
    """Triangles (t, 3) without those between the same corners as others.

    Of as many on either side none is left, as of the wall between two bodies, unless nearly all are
    such, as of a surface with two sides; else one on the side that has more.
    """
    rising = np.sort(triangles, axis=1)
    order = np.lexsort(rising.T)
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (rising[order[1:]] != rising[order[:-1]]).any(axis=1)
    if is_new.all():
        return triangles
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.cumsum(is_new) - 1
    lowest = triangles.argmin(axis=1)
    after, before = (
        np.take_along_axis(triangles, ((lowest + k) % 3)[:, None], axis=1)[:, 0] for k in (1, 2)
    )
    side = np.where(after < before, 1, -1)
    more = np.sign(np.bincount(group, side)).astype(np.int64)
    if np.mean(more == 0) >= _TWO_SIDED:
        more = np.where(more == 0, side[order[is_new]], more)
    first = np.full(len(more), len(triangles))
    kept = np.flatnonzero(side == more[group])
    np.minimum.at(first, group[kept], kept)
    return triangles[np.sort(first[more != 0])]


def _agreeing(triangles: Integers) -> tuple[Integers, Integers]:
    """Triangles (t, 3), as few as possible reversed for those that share an edge with just one
    other to be wound alike, and (t,) numbers of the parts that hang together by such edges."""
    count = len(triangles)
    rising = triangles.ravel() < np.roll(triangles, -1, axis=1).ravel()
    keys = edge_keys(triangles)
    order = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    sizes = np.diff(starts, append=len(order))
    pairs = starts[sizes == 2]
    first, second = order[pairs], order[pairs + 1]
    left, right = first // 3, second // 3
    shift = np.where(rising[first] == rising[second], count, 0)
    rows = np.concatenate((left, left + count))
    columns = np.concatenate((right + shift, right + count - shift))
    parts = connected_parts(rows, columns, 2 * count)
    kept, turned = parts[:count], parts[count:]
    weight = np.bincount(kept, minlength=int(parts.max()) + 1)
    flip = (weight[kept] < weight[turned]) | ((weight[kept] == weight[turned]) & (kept > turned))
    oriented = np.where(flip[:, None], triangles[:, ::-1], triangles)
    return oriented, np.unique(np.minimum(kept, turned), return_inverse=True)[1]


def oriented_shells(points: Floats, triangles: Integers) -> tuple[Integers, int]:
    """Turn the shells that lie beside others and are oriented against them.

    The largest shell says which orientation is that of bodies. One of the other orientation is a
    cavity where it lies inside a body, and is turned where it does not.

    points: (n, 3); triangles: (t, 3) of a closed oriented surface (see `is_closed`). Returns the
    same triangles in the same order, some reversed, and the number of shells turned.
    """
    shell = shells_of(triangles)
    if not shell.any():
        return triangles, 0
    offsets = points - points.mean(axis=0)
    a, b, c = offsets[triangles].transpose(1, 0, 2)
    volumes = np.bincount(shell, weights=(a * np.linalg.cross(b, c)).sum(-1) / 6.0)
    outward = np.sign(volumes[np.argmax(np.abs(volumes))])
    extent = float(np.ptp(points, axis=0).max())
    opposite = np.flatnonzero(outward * volumes < -VOLUME_TOLERANCE * extent**3)
    bodies = offsets[triangles[(outward * volumes > 0.0)[shell]]]
    beside = []
    for k in opposite:
        # The winding number at the first point of it that does not lie on the bodies' surface,
        # where it is no integer.
        for point in offsets[triangles[shell == k]].mean(axis=1):
            winding = abs(winding_number(point, bodies))
            if abs(winding - round(winding)) < _CLEAR:
                break
        if round(winding) == 0:
            beside.append(k)
    turned = np.isin(shell, beside)
    return np.where(turned[:, None], triangles[:, ::-1], triangles), len(beside)


def shells_of(triangles: Integers) -> Integers:
    """(t,) the shell of each triangle (t, 3); triangles of one shell are joined by edges."""
    shells = kernels.shells(triangles)
    if shells is not kernels.UNDECIDED:
        return shells
    keys = edge_keys(triangles)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    return connected_parts(order[:-1][same] // 3, order[1:][same] // 3, len(triangles))


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
    if isinstance(request, str) and request == "hull":
        return hull_centroid, "uniform solid hull", ()
    if request is not None:
        try:
            center = np.asarray(request, dtype=np.float64)
        except (ValueError, TypeError):
            center = np.zeros(0)
        if center.shape != (3,) or not np.isfinite(center).all():
            raise InputError(
                f'center of mass: expected "hull" or three finite numbers x,y,z, got {request!r}; '
                "give one of them or leave it out"
            )
        return center, "given", ()
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
