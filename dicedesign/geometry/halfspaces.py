"""Convex polyhedra as intersections of half-spaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hull import convex_hull

__all__ = ["polyhedron_corners"]


def polyhedron_corners(normals: ArrayLike, offsets: ArrayLike) -> NDArray[np.float64]:
    """Corners of the intersection of half-spaces `normals[i] . x <= offsets[i]`.

    By polarity: corner = plane of a facet of the convex hull of the points n_i / d_i.

    Parameters
    ----------
    normals: (m, 3), m >= 4, not necessarily unit.
    offsets: (m,) positive, so that the origin is strictly inside.

    Raises
    ------
    DegenerateBodyError: the intersection is unbounded or the origin is not strictly inside.

    Returns (n, 3).
    """
    n = np.asarray(normals, dtype=np.float64)
    d = np.asarray(offsets, dtype=np.float64)
    polar = convex_hull(n / d[:, None])
    feet = polar.vertices[polar.tail[polar.facet_start[:-1]]]
    heights = (feet * polar.normals).sum(-1)
    if (d <= 0.0).any() or (heights <= 0.0).any():
        raise DegenerateBodyError(
            "half-spaces: expected an intersection that is bounded and has the origin inside; "
            "spread the normals over the whole sphere and keep the offsets positive"
        )
    return polar.normals / heights[:, None]
