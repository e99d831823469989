"""Bodies: points and perhaps triangles, checked and welded; the solid that the triangles bound,
with its shells consistently oriented; and its center of mass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.triangles import (
    Surface,
    doubled_area_vectors,
    edge_keys,
    find_parts,
    is_closed,
    solid_properties,
    winding_number,
)
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index
from dicedesign.tolerances import ROUNDED_DIGITS, SMALLEST_EXTENT, VOLUME_TOLERANCE

_POWERS_OF_TEN = np.array([float(f"1e{k}") for k in range(23)])
"""The exact ones in float64: a quotient by one of them is the float nearest to the decimal."""


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass, center of mass and inertia of a body.

    Attributes
    ----------
    mass: above 0, in the unit of the densities times the cubed unit of length.
    center_of_mass: (3,) in the body's coordinates.
    inertia: (3, 3) tensor about the center of mass over the mass, in squared units of length.
    source: where it is from, in words.
    volume: of the solid, in cubed units of length.
    """

    mass: float
    center_of_mass: Floats
    inertia: Floats
    source: str
    volume: float


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

    @property
    def surface(self) -> Surface:
        """Surface of a body that came as a mesh."""
        assert self.triangles is not None
        return Surface(self.points, self.triangles)

    @cached_property
    def shells(self) -> Integers:
        """(t,) connected part of each triangle, see `shells_of`; none for a point cloud."""
        return np.zeros(0, np.int64) if self.triangles is None else shells_of(self.triangles)


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
    notes = []
    if faces is not None:
        outside = (faces < 0) | (faces >= len(positions))
        if outside.any():
            row, column = np.argwhere(outside)[0]
            raise InputError(
                f"{name}: expected triangles of points 0 to {len(positions) - 1}, got point "
                f"{faces[row, column]} in triangle {row}; export the mesh again"
            )
        used = np.zeros(len(positions), dtype=bool)
        used[faces] = True
        if not used.all():
            notes.append(f"ignored {np.count_nonzero(~used)} points that are on no triangle")
            positions, faces = positions[used], (np.cumsum(used) - 1)[faces]
    # Texture and normal seams leave points at equal positions.
    first, place = merge_positions(positions)
    if len(first) < len(positions):
        notes.append(f"welded {len(positions) - len(first)} points to others at equal positions")
    if faces is not None:
        faces = place[faces]
        whole = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        if not whole.all():
            dropped = np.count_nonzero(~whole)
            notes.append(f"dropped {dropped} triangles with a repeated corner")
        faces = faces[whole] if whole.any() else None
    if len(first) < 4:
        raise DegenerateBodyError(
            f"{name}: expected at least 4 distinct points that span a solid, got {len(first)}; "
            "add points"
        )
    return Body(positions[first], faces, name, single, tuple(notes))


def body_of(mesh: Any, name: str | None = None) -> Body:
    """`Body` of a `Surface`, of a mesh object with `vertices` (n, 3) and perhaps triangular `faces`
    (t, 3), or of points (n, 3); a `Body` is returned unchanged. name: of any other body, "mesh" or
    "points" by default. Raises as `make_body`."""
    if isinstance(mesh, Body):
        return mesh
    if isinstance(mesh, Surface):
        return make_body(mesh.points, mesh.triangles, name or "mesh")
    if not hasattr(mesh, "vertices"):
        return make_body(mesh, name=name or "points")
    name = name or "mesh"
    vertices = as_numbers(mesh.vertices, name)
    faces = getattr(mesh, "faces", None)
    return make_body(vertices, faces, name=name, single_precision=is_rounded(vertices))


def merge_positions(points: Floats) -> tuple[Integers, Integers]:
    """The first point (m,) at each position of points (n, 3), in order, and (n,) the place of each
    point's position there."""
    positions = kernels.merge_positions(points)
    if positions is not kernels.UNDECIDED:
        return positions
    # Adding 0 makes -0 and 0 equal.
    _, first, group = np.unique(points + 0.0, axis=0, return_index=True, return_inverse=True)
    by_occurrence = np.argsort(first)
    return first[by_occurrence], np.argsort(by_occurrence)[group]


def as_numbers(
    values: ArrayLike, name: str, what: str = "points", *, integer: bool = False
) -> NDArray[Any]:
    """`values` as an (n, 3) array of real or integer numbers, n >= 1, in its own precision.

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
    digits. Short numbers, such as the corners of a unit cube, count too.

    points: (n, 3) as written in the file, before any transform; others than finite ones are
    ignored.
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


_CLEAR = 0.25
"""Distance from an integer below which a winding number counts as that integer; on a flat part of
the surface it is a half."""

_OPEN = 0.1
"""Area of a flat cover of a patch's holes, relative to the patch's own, up to which the patch has
an inside."""

_TWO_SIDED = 0.9
"""Least share of triangles that occur with both orientations in a two-sided surface."""


def close_triangles(triangles: Integers) -> tuple[Integers, tuple[str, ...]] | None:
    """Triangles (t, 3) oriented as a closed surface, and notes on reversed ones; None if they
    do not close."""
    if is_closed(triangles):
        return triangles, ()
    oriented = consistent_winding(triangles)
    if oriented is None:
        return None
    count = np.count_nonzero((oriented != triangles).any(axis=1))
    return oriented, (f"reversed {count} triangles that were wound against their neighbors",)


def consistent_winding(triangles: Integers) -> Integers | None:
    """Reverse as few triangles as needed for a closed, consistently oriented surface.

    Each triangle is two nodes of a graph, one as it is and one reversed, and two triangles that
    share an edge link the nodes that agree. An orientable part of the surface falls into two
    components, one the reverse of the other; the one that reverses fewer triangles is taken.

    triangles: (t, 3) vertex indices, nonnegative. Returns the triangles in their order,
    some reversed, or None when no choice closes the surface, because it has a boundary or is
    one-sided.
    """
    if len(triangles) == 0:
        return None
    oriented, _ = _agreeing(triangles)
    return oriented if is_closed(oriented) else None


def outward_patches(points: Floats, triangles: Integers) -> Integers:
    """Orient triangles (t, 3) consistently, and outward as far as they determine it.

    A patch is a set of triangles connected by edges of exactly two triangles. In each patch as few
    triangles as needed are reversed; a closed or nearly closed patch is then oriented outward, be
    it a body or a cavity.

    points: (n, 3). Returns the triangles in their order, some reversed.
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
    """Triangles (t, 3) without duplicates (equal corners).

    Of the triangles between three corners one remains, with the orientation that more of them have.
    Where both orientations are equally frequent, as in a wall between two bodies, none remains,
    unless nearly all triangles are like that, as in a two-sided surface.
    """
    first, group = merge_positions(np.sort(triangles, axis=1).astype(np.float64))
    if len(first) == len(triangles):
        return triangles
    lowest = triangles.argmin(axis=1)
    after, before = (
        np.take_along_axis(triangles, ((lowest + k) % 3)[:, None], axis=1)[:, 0] for k in (1, 2)
    )
    side = np.where(after < before, 1, -1)
    more = np.sign(np.bincount(group, side)).astype(np.int64)
    if np.mean(more == 0) >= _TWO_SIDED:
        more = np.where(more == 0, side[first], more)
    major = np.flatnonzero(side == more[group])
    return triangles[major[np.sort(np.unique(group[major], return_index=True)[1])]]


def _agreeing(triangles: Integers) -> tuple[Integers, Integers]:
    """Triangles (t, 3) with as few as possible reversed, so that neighbors across an edge of
    exactly two agree; and (t,) the connected part of each."""
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
    parts = find_parts(rows, columns, 2 * count)
    first_parts, turned = parts[:count], parts[count:]
    weight = np.bincount(first_parts, minlength=int(parts.max()) + 1)
    flip = (weight[first_parts] < weight[turned]) | (
        (weight[first_parts] == weight[turned]) & (first_parts > turned)
    )
    oriented = np.where(flip[:, None], triangles[:, ::-1], triangles)
    return oriented, np.unique(np.minimum(first_parts, turned), return_inverse=True)[1]


def orient_shells(points: Floats, triangles: Integers, shell: Integers) -> tuple[Integers, int]:
    """Turn the shells that lie beside others and are oriented against them.

    The largest shell counts as a body. A shell of the opposite orientation is a cavity inside a
    body, and is turned where it is outside all of them.

    points: (n, 3); triangles: (t, 3) of a closed oriented surface (see `is_closed`); shell: (t,) of
    each. Returns the triangles in their order, some reversed, and the number of shells turned.
    """
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
        # The winding number at the shell's first point off the bodies' surface, where it is not an
        # integer.
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
    return find_parts(order[:-1][same] // 3, order[1:][same] // 3, len(triangles))


def resolve_center_of_mass(
    body: Body,
    hull_centroid: Floats,
    request: Literal["hull"] | ArrayLike | None = None,
) -> tuple[Floats, str, tuple[str, ...]]:
    """Center of mass of a body, its source, and assumptions.

    Parameters
    ----------
    body: its triangles, if any, need not be closed or consistently wound.
    hull_centroid: (3,) centroid of the body's convex hull, taken for a point cloud, an open mesh
        or on request.
    request: "hull", or (3,) numbers in the unit of the points; None decides by the densities of the
        body, or else by the mesh.

    Returns
    -------
    (3,) the center in the unit of the points, not checked to lie inside the hull; its source
    "uniform solid", "uniform solid hull", "given" or the source of `MassProperties`; and
    assumptions and re-orientations, one sentence each.

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
            f"extent of {extent:.3g}; give a center of mass with --com x,y,z, or use the center "
            "of the convex hull with --com hull"
        )
    if volume < 0 and not notes:
        notes = ("the mesh is oriented inward and was taken as a solid",)
    return centroid, "uniform solid", notes


def solid_triangles(body: Body) -> tuple[Integers, tuple[str, ...]] | None:
    """Consistently oriented triangles (t, 3) that bound a body's solid, and one sentence for each
    repair; None for a point cloud or an open mesh. All may point inward."""
    closed = None if body.triangles is None else close_triangles(body.triangles)
    if closed is None:
        return None
    triangles, notes = closed
    triangles, turned = orient_shells(body.points, triangles, body.shells)
    if turned > 0:
        notes += (f"turned {turned} shells that lie beside others and were oriented against them",)
    return triangles, notes
