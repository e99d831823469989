"""Volume and centroid of a closed triangle surface, and whether it is closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["is_closed", "solid_properties"]


def solid_properties(
    points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[float, NDArray[np.float64]]:
    """Signed volume and centroid of the uniform solid a closed surface bounds.

    The volume is summed over signed tetrahedra from the mean of the points, in units of the
    body's own size, so a body far from the origin or of any scale loses nothing.

    Parameters
    ----------
    points: (n, 3) finite coordinates, any length unit.
    triangles: (t, 3) indices into `points` of a closed oriented surface (see `is_closed`); it may
        consist of several shells, and an inward shell inside an outward one is a cavity.

    Returns
    -------
    The volume in the cubed unit of the points, positive when the surface is oriented outward, and
    (3,) the centroid, the same for either orientation; NaN when the volume is exactly zero.
    """
    reference = points.mean(axis=0)
    offsets = points - reference
    scale = float(np.abs(offsets).max())
    if scale == 0.0:
        return 0.0, np.full(3, np.nan)
    a, b, c = np.moveaxis((offsets / scale)[triangles], 1, 0)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    if volume == 0.0:
        return 0.0, np.full(3, np.nan)
    moment = (volumes[:, None] * (a + b + c)).sum(axis=0) / 4.0
    return volume * scale**3, reference + scale * (moment / volume)


def is_closed(triangles: NDArray[np.int64]) -> bool:
    """Whether the triangles form a closed, consistently oriented surface.

    They do when every undirected edge is passed equally often in both directions. Several shells,
    and edges where four or more triangles meet, are allowed.

    triangles: (t, 3) vertex indices, nonnegative; vertices at one position must share one index.
    Returns False also when there is no triangle.
    """
    if len(triangles) == 0:
        return False
    tails = triangles.ravel()
    heads = np.roll(triangles, -1, axis=1).ravel()
    count = int(triangles.max()) + 1
    keys = np.minimum(tails, heads) * count + np.maximum(tails, heads)
    _, edges = np.unique(keys, return_inverse=True)
    balance = np.bincount(edges, weights=np.where(tails < heads, 1.0, -1.0))
    return not balance.any()
