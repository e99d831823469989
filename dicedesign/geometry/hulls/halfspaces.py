"""Convex polyhedra as intersections of half-spaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import as_numbers
from dicedesign.runtime.arrays import Floats


def polyhedron_corners(normals: ArrayLike, offsets: ArrayLike) -> NDArray[np.float64]:
    """Corners of the intersection of half-spaces `normals[i] . x <= offsets[i]`.

    By polarity: corner = plane of a facet of the convex hull of the points n_i / d_i.

    Parameters
    ----------
    normals: (m, 3), m >= 4, not necessarily unit.
    offsets: (m,) positive, so that the origin is strictly inside.

    Raises
    ------
    InputError: the shapes do not agree, or a number is missing or not finite.
    DegenerateBodyError: the intersection is unbounded or the origin is not strictly inside.

    Returns (n, 3).
    """
    n = as_numbers(normals, "half-spaces", "normals").astype(np.float64)
    d = _offsets(offsets, len(n))
    if not np.isfinite(n).all():
        row = int(np.argmin(np.isfinite(n).all(axis=1)))
        raise InputError(
            f"half-spaces: expected finite normals, got {n[row].tolist()} in row {row}; repair it"
        )
    if (d <= 0.0).any():
        raise _no_polyhedron(f"offset {d.min():g}")
    polar = convex_hull(n / d[:, None])
    heights = polar.heights(np.zeros(3))
    if (heights <= 0.0).any():
        raise _no_polyhedron("one that is unbounded")
    return polar.normals / heights[:, None]


def deepest_point(normals: Floats, offsets: Floats) -> tuple[Floats, float]:
    """The point (3,) whose least distance from the planes `normals[i] . x = offsets[i]` is largest,
    and that distance: not above 0 where nothing is inside of all, and infinite where that is
    unbounded; the point is the origin then, and where no linear program finds one.

    normals: (m, 3) unit; offsets: (m,), from a point that is not far from them.
    """
    # Imported late: few need it.
    from scipy.optimize import linprog

    size = float(np.abs(offsets).max())
    rows = np.column_stack([normals, np.ones(len(offsets))])
    bounds = [(None, None)] * 4
    found = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows, b_ub=offsets / size, bounds=bounds)
    if found.x is None or found.status == 3:
        return np.zeros(3), np.inf if found.status == 3 else -np.inf
    return size * found.x[:3], size * float(found.x[3])


def _offsets(offsets: ArrayLike, count: int) -> NDArray[np.float64]:
    try:
        array = np.asarray(offsets, dtype=np.float64)
    except (ValueError, TypeError) as error:
        raise _bad_offsets(count, repr(offsets)) from error
    if array.shape != (count,):
        raise _bad_offsets(count, f"shape {array.shape}")
    if not np.isfinite(array).all():
        raise _bad_offsets(count, repr(array[~np.isfinite(array)][0].item()))
    return array


def _bad_offsets(count: int, got: str) -> InputError:
    return InputError(
        f"half-spaces: expected {count} finite offsets, got {got}; pass one for each normal"
    )


def _no_polyhedron(got: str) -> DegenerateBodyError:
    return DegenerateBodyError(
        "half-spaces: expected an intersection that is bounded and has the origin inside, got "
        f"{got}; spread the normals over the whole sphere and keep the offsets positive"
    )
