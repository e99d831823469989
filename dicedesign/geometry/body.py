"""A body as it comes in: points, perhaps triangles, checked and welded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import DegenerateBodyError, InputError

__all__ = ["Body", "make_body", "weld"]


@dataclass(frozen=True, eq=False)
class Body:
    """Points of a body and, when it came as a mesh, its triangles.

    Attributes
    ----------
    points : (n, 3) float64
        Distinct finite positions, n >= 4, any length unit.
    triangles : (t, 3) int64 or None
        Indices into `points`; None for a point cloud. The mesh may be open, inconsistently
        wound or self-intersecting.
    name : str
        What error messages and reports call the body; for a file, its path.
    single_precision : bool
        The coordinates were rounded to float32 or to as few decimal digits.
    notes : tuple of str
        What was repaired on the way in, one sentence each.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64] | None
    name: str
    single_precision: bool
    notes: tuple[str, ...]


def make_body(
    points: ArrayLike,
    triangles: ArrayLike | None = None,
    name: str = "points",
    single_precision: bool = False,
) -> Body:
    """Check and weld points and triangles.

    Points on no triangle of a mesh are dropped, equal positions become one point.

    Parameters
    ----------
    points : (n, 3) real
        Coordinates, any length unit. A float32 array counts as single precision.
    triangles : (t, 3) int, optional
        Zero-based indices into `points`; without any triangle the body is a point cloud.
    name : str
        What to call the body in messages.
    single_precision : bool
        Whether the coordinates were rounded to float32 before they came here.

    Raises
    ------
    InputError
        An array has the wrong shape or type, or an index refers to no point.
    DegenerateBodyError
        A coordinate is not finite, or there are fewer than 4 distinct points.
    """
    array = _numbers(points, f"{name}: points", "real", "iuf")
    single = single_precision or (array.dtype.kind == "f" and array.dtype.itemsize <= 4)
    positions = array.astype(np.float64)
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        raise DegenerateBodyError(
            f"{name}: {np.count_nonzero(~finite)} of {len(positions)} points are not finite, the "
            f"first is point {first}: {positions[first].tolist()}; remove them"
        )
    faces: NDArray[np.int64] | None = None
    if triangles is not None and np.size(triangles) > 0:
        faces = _numbers(triangles, f"{name}: triangles", "integer", "iu").astype(np.int64)
        _check_range(faces, len(positions), name)

    notes = []
    if faces is not None:
        used, renumbered = np.unique(faces, return_inverse=True)
        if len(used) < len(positions):
            notes.append(f"ignored {len(positions) - len(used)} points that are on no triangle")
        positions, faces = positions[used], renumbered.reshape(faces.shape)
    welded, welded_faces = weld(positions, faces)
    if len(welded) < len(positions):
        notes.append(f"welded {len(positions) - len(welded)} points to others at equal positions")
    if faces is not None and welded_faces is not None and len(welded_faces) < len(faces):
        notes.append(f"dropped {len(faces) - len(welded_faces)} triangles with a repeated corner")
        if len(welded_faces) == 0:
            welded_faces = None
    if len(welded) < 4:
        raise DegenerateBodyError(
            f"{name}: expected at least 4 distinct points that span a solid, got {len(welded)}; "
            "add points"
        )
    return Body(welded, welded_faces, name, single, tuple(notes))


def weld(
    points: NDArray[np.float64], triangles: NDArray[np.int64] | None
) -> tuple[NDArray[np.float64], NDArray[np.int64] | None]:
    """Merge points at exactly equal positions, as texture and normal seams leave them.

    Parameters
    ----------
    points : (n, 3) float
        Finite coordinates.
    triangles : (t, 3) int or None
        Indices into `points`.

    Returns
    -------
    points : (m, 3) float
        The distinct positions, in the order in which they first occur.
    triangles : (u, 3) int or None
        Without those that lost a corner by the merging.
    """
    order = np.lexsort(points.T)
    ranked = points[order]
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.cumsum(is_new) - 1
    first = order[is_new]  # lexsort is stable: the first of its group
    by_occurrence = np.argsort(first)
    new_index = np.empty_like(by_occurrence)
    new_index[by_occurrence] = np.arange(len(first))
    kept = points[first[by_occurrence]]
    if triangles is None:
        return kept, None
    faces = new_index[group[triangles]]
    whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return kept, faces[whole]


def _numbers(values: ArrayLike, what: str, kind: str, dtype_kinds: str) -> NDArray[Any]:
    """`values` as an (n, 3) array of the wanted kind, or an InputError about `what`."""
    expected = f"{what} must be an (n, 3) array of {kind} numbers"
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:
        raise InputError(f"{expected}, got rows of different lengths") from error
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise InputError(f"{expected}, got shape {array.shape}")
    if array.dtype.kind not in dtype_kinds:
        raise InputError(f"{expected}, got dtype {array.dtype}")
    return array


def _check_range(faces: NDArray[np.int64], count: int, name: str) -> None:
    outside = (faces < 0) | (faces >= count)
    if outside.any():
        row, column = np.argwhere(outside)[0]
        raise InputError(
            f"{name}: triangle {row} refers to point {faces[row, column]}, but points are numbered "
            f"0 to {count - 1}; export the mesh again"
        )
