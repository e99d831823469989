"""A body as it comes in: points, perhaps triangles, checked and welded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import ROUNDED_DIGITS, SMALLEST_EXTENT

_POWERS_OF_TEN: Final = np.array([float(f"1e{k}") for k in range(23)])
"""Those that are float64 numbers, so that a quotient by them is the nearest to the decimal."""


@dataclass(frozen=True, eq=False)
class MassProperties:
    """What is known of how a body's mass lies.

    Attributes
    ----------
    mass: above 0, in the unit of the densities times the cubed unit of length.
    center_of_mass: (3,) in the body's coordinates.
    inertia: (3, 3) tensor about the center of mass over the mass, in squared units of length.
    source: where it is from, in words.
    """

    mass: float
    center_of_mass: Floats
    inertia: Floats
    source: str


@dataclass(frozen=True, eq=False)
class Body:
    """Points of a body and, when it came as a mesh, its triangles.

    Attributes
    ----------
    points: (n, 3) distinct finite positions, n >= 4, any length unit.
    triangles: (t, 3) indices into `points`, or None for a point cloud. The mesh may be open,
        inconsistently wound or self-intersecting.
    name: what error messages and reports call the body; for a file, its path.
    single_precision: the coordinates were rounded to float32 or to as few decimal digits.
    notes: what was repaired on the way in, one sentence each.
    mass_properties: of a body of several densities, or None for one of a single density.
    """

    points: Floats
    triangles: Integers | None
    name: str
    single_precision: bool
    notes: tuple[str, ...]
    mass_properties: MassProperties | None = None


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
    points: (n, 3) real, any length unit. A float32 array counts as single precision.
    triangles: (t, 3) zero-based indices into `points`; without any triangle the body is a point
        cloud.
    name: what to call the body in messages.
    single_precision: whether the coordinates were rounded to float32 before they came here.

    Raises
    ------
    InputError: an array has the wrong shape or type, or an index refers to no point.
    DegenerateBodyError: a coordinate is not finite, coordinates are so large or their extent is so
        small that products of a few overflow, or there are fewer than 4 distinct points.
    """
    array = as_numbers(points, name)
    single = single_precision or (array.dtype.kind == "f" and array.dtype.itemsize <= 4)
    positions = array.astype(np.float64, order="C")
    if not kernels.are_proper(positions, SMALLEST_EXTENT):
        _check_coordinates(positions, name)
    faces: Integers | None = None
    if triangles is not None and np.size(triangles) > 0:
        faces = as_numbers(triangles, name, "triangles", integer=True).astype(np.int64)
        _check_range(faces, len(positions), name)

    notes = []
    if faces is not None:
        used = np.zeros(len(positions), dtype=bool)
        used[faces] = True
        if not used.all():
            notes.append(f"ignored {np.count_nonzero(~used)} points that are on no triangle")
            positions, faces = positions[used], (np.cumsum(used) - 1)[faces]
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


def body_of(mesh: Any, name: str = "mesh") -> Body:
    """A `Body` as it is, a mesh object with `vertices` (n, 3) and perhaps triangular `faces` (t,
    3), or points (n, 3). Raises as `make_body`; name: what to call what has no name."""
    if isinstance(mesh, Body):
        return mesh
    if not hasattr(mesh, "vertices"):
        return make_body(mesh, name=name)
    vertices = as_numbers(mesh.vertices, name)
    faces = getattr(mesh, "faces", None)
    return make_body(vertices, faces, name=name, single_precision=is_rounded(vertices))


def weld(points: Floats, triangles: Integers | None) -> tuple[Floats, Integers | None]:
    """Merge points at exactly equal positions, as texture and normal seams leave them.

    Parameters
    ----------
    points: (n, 3) finite coordinates.
    triangles: (t, 3) indices into `points`, or None.

    Returns
    -------
    (m, 3) the distinct positions, in the order in which they first occur, and (u, 3) the triangles
    without those that lost a corner by the merging, or None.
    """
    first, group = repeated_positions(points)
    points, triangles = points[first], None if triangles is None else group[triangles]
    if triangles is None:
        return points, None
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return points, triangles[whole]


def repeated_positions(points: Floats) -> tuple[Integers, Integers]:
    """The first point (m,) at each position of points (n, 3), in order, and (n,) the place of each
    point's position there."""
    positions = kernels.repeated_positions(points)
    if positions is not kernels.UNDECIDED:
        return positions
    order = np.lexsort(points.T)
    ranked = points[order]
    is_new = np.ones(len(order), dtype=bool)
    is_new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.cumsum(is_new) - 1
    first = order[is_new]  # lexsort is stable: the first of its group
    by_occurrence = np.argsort(first)
    place = np.empty_like(by_occurrence)
    place[by_occurrence] = np.arange(len(first))
    return first[by_occurrence], place[group]


def as_numbers(
    values: ArrayLike, name: str, what: str = "points", *, integer: bool = False
) -> NDArray[Any]:
    """`values` as an (n, 3) array of real or of integer numbers, n >= 1, of whatever precision.

    name: what messages begin with; what: the values in a word, in the plural.
    Raises InputError: the shape or the type is another.
    """
    kind = "integer" if integer else "real"
    expected = f"{name}: expected {what} as an (n, 3) array of {kind} numbers"
    remedy = "pass one row of three numbers for each"
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:
        raise InputError(f"{expected}, got rows of different lengths; {remedy}") from error
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0:
        raise InputError(f"{expected}, got shape {array.shape}; {remedy}")
    if array.dtype.kind not in ("iu" if integer else "iuf"):
        raise InputError(f"{expected}, got dtype {array.dtype}; {remedy}")
    return array


def is_rounded(points: Floats) -> bool:
    """True if coordinates from a file carry no more than single precision.

    They do when all are float32 values, or all have at most `ROUNDED_DIGITS` significant decimal
    digits. Numbers that are short by themselves, such as the corners of a unit cube, count too.

    points: (n, 3) as they stand in the file, before any transform; those that are not finite are
    left out of account.
    """
    with np.errstate(over="ignore"):
        if np.array_equal(points, points.astype(np.float32)):
            return True
    values = points[np.isfinite(points) & (points != 0.0)]
    places = ROUNDED_DIGITS - 1 - np.floor(np.log10(np.abs(values)))
    powers = _POWERS_OF_TEN[np.clip(places, 0, len(_POWERS_OF_TEN) - 1).astype(np.int64)]
    digits = np.rint(values * powers)
    short = (np.abs(digits) < 10.0**ROUNDED_DIGITS) & (digits / powers == values)
    return all(float(f"{value:.{ROUNDED_DIGITS - 1}e}") == value for value in values[~short])


def _check_coordinates(positions: Floats, name: str) -> None:
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        raise DegenerateBodyError(
            f"{name}: expected finite coordinates, got {positions[first].tolist()} in point "
            f"{first} ({np.count_nonzero(~finite)} of {len(positions)} points are not finite); "
            "remove or repair them"
        )
    largest, extent = float(np.abs(positions).max()), float(np.ptp(positions, axis=0).max())
    if largest > 1.0 / SMALLEST_EXTENT or 0.0 < extent < SMALLEST_EXTENT:
        raise DegenerateBodyError(
            f"{name}: expected coordinates of at most {1.0 / SMALLEST_EXTENT:g}, an extent of at "
            f"least {SMALLEST_EXTENT:g}, got {largest:.3g} and {extent:.3g}; use another unit of "
            "length"
        )


def _check_range(faces: Integers, count: int, name: str) -> None:
    outside = (faces < 0) | (faces >= count)
    if outside.any():
        row, column = np.argwhere(outside)[0]
        raise InputError(
            f"{name}: expected triangles of points 0 to {count - 1}, got point "
            f"{faces[row, column]} in triangle {row}; export the mesh again"
        )
