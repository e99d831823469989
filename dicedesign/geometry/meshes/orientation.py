"""Closed triangle surfaces wound alike: each triangle like its neighbors, each shell like those
around it."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.solid import is_closed
from dicedesign.geometry.triangles import connected_parts, edge_keys, winding_number
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import VOLUME_TOLERANCE

__all__ = ["closed_triangles", "consistent_winding", "oriented_shells", "shells_of"]

_CLEAR: Final = 0.25
"""A winding number that is nearer than this to an integer is that integer; for a point on a flat
part of the surface it is a half."""


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
    count = len(triangles)
    if count == 0:
        return None
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
    return oriented if is_closed(oriented) else None


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
    beside = [k for k in opposite if not _is_inside(offsets[triangles[shell == k]], bodies)]
    turned = np.isin(shell, beside)
    return np.where(turned[:, None], triangles[:, ::-1], triangles), len(beside)


def shells_of(triangles: Integers) -> Integers:
    """(t,) the shell of each triangle (t, 3); triangles of one shell are joined by edges."""
    shells = kernels.shells(triangles)
    if shells is not None:
        return shells
    keys = edge_keys(triangles)
    order = np.argsort(keys, kind="stable")
    same = keys[order[1:]] == keys[order[:-1]]
    return connected_parts(order[:-1][same] // 3, order[1:][same] // 3, len(triangles))


def _is_inside(shell: Floats, bodies: Floats) -> bool:
    """True if a shell (s, 3, 3) lies inside bodies (t, 3, 3), by the winding number of a point of
    it: the first that does not lie on their surface, where that number is no integer."""
    winding = 0.0
    for point in shell.mean(axis=1):
        winding = abs(winding_number(point, bodies))
        if abs(winding - round(winding)) < _CLEAR:
            break
    return round(winding) != 0
