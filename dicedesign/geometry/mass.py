"""Volume and centroid of a closed triangle surface, and whether it is closed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dicedesign.tolerances import THIN_VOLUME

__all__ = ["is_closed", "principal_axes", "solid_properties"]

Floats = NDArray[np.float64]


def solid_properties(points: Floats, triangles: NDArray[np.int64]) -> tuple[float, Floats]:
    """Signed volume and centroid of the uniform solid a closed surface bounds.

    The volume is summed over signed tetrahedra from the mean of the points, in units of the
    body's own size, so a body far from the origin or of any scale loses nothing. That of a needle
    or a plate is summed in its `principal_axes`.

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
    offsets = offsets / scale
    volume, centroid = _sums(offsets, triangles)
    thin = principal_axes(offsets, volume)
    if thin is not None:
        axes, sizes = thin
        volume, centroid = _sums(offsets @ axes.T / sizes, triangles)
        volume, centroid = volume * float(sizes.prod()), (centroid * sizes) @ axes
    return volume * scale**3, reference + scale * centroid


def principal_axes(offsets: Floats, volume: float) -> tuple[Floats, Floats] | None:
    """Axes and sizes in which a needle or a plate is about as thick as it is long.

    Of a body A times as long as thick, the sums over tetrahedra lose some A^2 units of rounding,
    for they cancel to that part of their terms, but only A when they are taken of the linear image
    `offsets @ axes.T / sizes`. The volume of the body is that of the image times the product of the
    sizes, its centroid `(centroid * sizes) @ axes` for the image's.

    offsets: (n, 3) points less a point near their mean; volume: of the body, to within rounding.
    Returns axes (3, 3), a rotation with one axis per row, and sizes (3,) in the unit of the
    offsets; None for a body that is not thin (`THIN_VOLUME`), or flat to within rounding.
    """
    if abs(volume) >= THIN_VOLUME * float(np.abs(offsets).max()) ** 3:
        return None
    _, sizes, axes = np.linalg.svd(offsets, full_matrices=False)
    if sizes[-1] <= np.finfo(np.float64).eps * sizes[0]:
        return None
    return axes * np.sign(np.linalg.det(axes)), sizes / np.sqrt(len(offsets))


def _sums(offsets: Floats, triangles: NDArray[np.int64]) -> tuple[float, Floats]:
    """Volume and centroid (3,) by tetrahedra from the origin."""
    a, b, c = np.moveaxis(offsets[triangles], 1, 0)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    if volume == 0.0:
        return 0.0, np.full(3, np.nan)
    return volume, (volumes[:, None] * (a + b + c)).sum(axis=0) / 4.0 / volume


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
