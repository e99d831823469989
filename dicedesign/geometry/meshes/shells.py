"""The shells of a closed surface: which are cavities and which are bodies of their own."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import VOLUME_TOLERANCE

__all__ = ["oriented_shells"]

_CLEAR: Final = 0.25
"""A winding number that is nearer than this to an integer is that integer; for a point on a flat
part of the surface it is a half."""


def oriented_shells(points: Floats, triangles: Integers) -> tuple[Integers, int]:
    """Turn the shells that lie beside others and are oriented against them.

    The largest shell says which orientation is that of bodies. One of the other orientation is a
    cavity where it lies inside a body, and is turned where it does not.

    points: (n, 3); triangles: (t, 3) of a closed oriented surface (see `is_closed`). Returns the
    same triangles in the same order, some reversed, and the number of shells turned.
    """
    shell = _shells(triangles)
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


def _shells(triangles: Integers) -> Integers:
    """(t,) the shell of each triangle; triangles of one shell are joined by edges."""
    numbers = kernels.shells(triangles)
    if numbers is not None:
        return numbers
    ends = np.sort(np.stack([triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()]), axis=0)
    order = np.lexsort(ends)
    same = (ends[:, order[1:]] == ends[:, order[:-1]]).all(axis=0)
    left, right = order[:-1][same] // 3, order[1:][same] // 3
    # Imported late: with kernels nobody needs it.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(left)), (left, right)), shape=(len(triangles),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _is_inside(shell: Floats, bodies: Floats) -> bool:
    """Whether a shell (s, 3, 3) lies inside bodies (t, 3, 3), by the winding number of a point of
    it: the first that does not lie on their surface, where that number is no integer."""
    winding = 0.0
    for point in shell.mean(axis=1):
        a, b, c = (bodies - point).transpose(1, 0, 2)
        winding = abs(float(signed_solid_angle(a, b, c, np).sum())) / (4.0 * np.pi)
        if abs(winding - round(winding)) < _CLEAR:
            break
    return round(winding) != 0
