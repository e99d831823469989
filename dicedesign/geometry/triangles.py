"""Triangle surfaces: areas, neighbors, points inside, and volume, centroid and inertia of the
uniform solid that a closed one bounds.

Sums over tetrahedra are written once, for NumPy and torch (`xp`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index
from dicedesign.tolerances import THIN_VOLUME


def doubled_area_vectors(points: Floats, triangles: Integers) -> Floats:
    """Normals of triangles, of length twice their areas.

    The cross product is taken of the two shorter edges: of two long and nearly parallel ones it
    would be rounding noise.

    points: (n, 3); triangles: (t, 3). Returns (t, 3), outward for triangles that run
    counter-clockwise seen from outside.
    """
    corners = points[triangles]
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
    apex = np.argmax((opposite * opposite).sum(-1), axis=1)
    rows = np.arange(len(triangles))
    a, b, c = (corners[rows, (apex + k) % 3] for k in range(3))
    return np.linalg.cross(b - a, c - a)


def edge_keys(triangles: Integers) -> Integers:
    """(3 t,) one number for the undirected edge at each corner of triangles (t, 3)."""
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = int(triangles.max()) + 1
    return np.minimum(tails, heads) * size + np.maximum(tails, heads)


def edge_neighbors(triangles: Integers) -> Integers:
    """Neighbors of triangles (t, 3): `[t, k]` lies across the edge opposite to corner k, or is -1
    unless exactly one triangle has that edge in the opposite direction and no other has it in the
    same."""
    tail, head = np.roll(triangles, -1, axis=1).ravel(), np.roll(triangles, -2, axis=1).ravel()
    size = np.int64(triangles.max()) + 1
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward, kind="stable")
    ranked = forward[order]
    first = np.searchsorted(ranked, backward)
    once = np.searchsorted(ranked, backward, side="right") == first + 1
    twin = order[np.minimum(first, len(order) - 1)]
    alone = np.bincount(np.searchsorted(ranked, forward), minlength=len(order))
    single = alone[np.searchsorted(ranked, forward)] == 1
    return np.where(once & single, twin // 3, -1).reshape(triangles.shape)


def find_parts(tails: Integers, heads: Integers, count: int) -> Integers:
    """(count,) the connected part of each node, numbered from 0 by first nodes, for edges (m,) and
    (m,)."""
    # Imported late: a query of a mesh does without SciPy.
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(tails)), (tails, heads)), shape=(count, count))
    labels: Integers = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


def winding_number(point: Floats, corners: Floats) -> float:
    """Winding number of closed oriented triangles (t, 3, 3) around a point (3,): an integer to
    within rounding, 0 outside, unless the point is on the surface."""
    a, b, c = (corners - point).transpose(1, 0, 2)
    return float(signed_solid_angle(a, b, c, np).sum()) / (4.0 * np.pi)


def solid_properties(points: Floats, triangles: Integers) -> tuple[float, Floats]:
    """Signed volume and centroid of the uniform solid a closed surface bounds.

    The volume is summed over signed tetrahedra from the mean of the points, in units of the
    body's own size, so a body far from the origin or of any scale loses nothing. Needles and plates
    are made thicker first, see `stretch_matrix`.

    Parameters
    ----------
    points: (n, 3) finite coordinates, any length unit.
    triangles: (t, 3) indices into `points` of a closed oriented surface (see `is_closed`); it may
        consist of several shells, and an inward shell inside an outward one is a cavity.

    Returns
    -------
    The volume in the cubed unit of the points, positive when the surface is oriented outward, and
    (3,) the centroid, for either orientation; NaN when the volume is exactly zero.
    """
    reference = points.mean(axis=0)
    offsets = points - reference
    scale = float(np.abs(offsets).max())
    if scale == 0.0:
        return 0.0, np.full(3, np.nan)
    offsets = offsets / scale
    volume, centroid = volume_and_centroid(offsets, triangles, np)
    stretch = stretch_matrix(offsets, volume)
    if stretch is not None:
        image = np.linalg.solve(stretch.T, offsets.T).T
        volume, centroid = volume_and_centroid(image, triangles, np)
        volume, centroid = volume * float(np.linalg.det(stretch)), centroid @ stretch
    return float(volume) * scale**3, reference + scale * centroid


def join_inertia(masses: Floats, centers: Floats, inertias: Floats) -> tuple[Floats, Floats]:
    """Center of mass (3,) of bodies that are fixed to each other, and their tensor of inertia
    (3, 3) about it for a mass of 1.

    masses: (n,), of a sum above 0; centers: (n, 3); inertias: (n, 3, 3) of each body about its own
    center for a mass of 1.
    """
    shares = masses / masses.sum()
    center = shares @ centers
    arms = centers - center
    squares = (arms * arms).sum(-1)[:, None, None] * np.eye(3)
    moved = inertias + squares - arms[:, :, None] * arms[:, None, :]
    return center, np.tensordot(shares, moved, 1)


def principal_axes(inertia: Floats) -> tuple[Floats, Floats]:
    """Principal moments (3,), ascending, of a tensor of inertia (3, 3), and its principal axes
    (3, 3) as columns, right-handed."""
    moments, axes = np.linalg.eigh(inertia)
    return moments, axes * np.array([1.0, 1.0, np.linalg.det(axes)]).round()


def second_moments(offsets: Any, triangles: Integers, xp: ModuleType) -> tuple[Any, Any]:
    """Integral (3, 3) of the products of two coordinates over a solid, and its volume.

    offsets: (n, 3) from the origin; triangles: (t, 3), see `solid_properties`.
    Source: second moments of a tetrahedron from the origin, with corners a, b, c and d = a + b + c:
    its volume over 20 times (d d^T + a a^T + b b^T + c c^T).
    """
    a, b, c = xp.moveaxis(offsets[triangles], 1, 0)
    volumes = xp.einsum("ij,ij->i", a, xp.linalg.cross(b, c)) / 6.0
    arms = (a, b, c, a + b + c)
    moments = sum(xp.einsum("t,ti,tj->ij", volumes, arm, arm) / 20.0 for arm in arms)
    return moments, volumes.sum()


def stretch_matrix(offsets: Floats, volume: float) -> Floats | None:
    """Linear map that makes a needle or a plate about as thick as it is long.

    Of a body A times as long as thick, the sums over tetrahedra lose some A^2 units of rounding,
    as they cancel to that part of their terms. Taken of `image`, with `offsets = image @ matrix`,
    they lose some A, for the rounding of the image, and hardly any where the body lies along the
    axes of coordinates. The body's volume is the image's times the determinant of the matrix, its
    centroid the image's times the matrix.

    offsets: (n, 3) points less a point near their mean; volume: of the body, to within rounding.
    Returns (3, 3), triangular but for the order of its columns; None for a body that is not thin
    (`THIN_VOLUME`), or is thinner than the rounding of its coordinates.
    """
    if abs(volume) >= THIN_VOLUME * float(np.abs(offsets).max()) ** 3:
        return None
    # Imported late: few bodies are thin, and SciPy takes longer to load than a query.
    from scipy.linalg import qr

    factor, order = qr(offsets, mode="r", pivoting=True)
    factor = factor[:3]
    if abs(factor[2, 2]) <= np.finfo(np.float64).eps * np.linalg.norm(factor[:, 2]):
        return None
    matrix: Floats = factor[:, np.argsort(order)] / np.sqrt(len(offsets))
    return matrix


def volume_and_centroid(offsets: Any, triangles: Integers, xp: ModuleType) -> tuple[Any, Any]:
    """Volume and centroid (3,) of a solid, by tetrahedra from the origin; NaN for a volume of 0.

    offsets: (n, 3) from the origin; triangles: (t, 3), see `solid_properties`.
    """
    a, b, c = xp.moveaxis(offsets[triangles], 1, 0)
    volumes = xp.einsum("ij,ij->i", a, xp.linalg.cross(b, c)) / 6.0
    volume = volumes.sum()
    if volume == 0.0:
        return volume, np.nan * offsets[0]
    return volume, (volumes[:, None] * (a + b + c)).sum(0) / 4.0 / volume


def is_closed(triangles: Integers) -> bool:
    """True if the triangles form a closed, consistently oriented surface.

    They do when every undirected edge is passed equally often in both directions. Several shells,
    and edges where four or more triangles meet, are allowed.

    triangles: (t, 3) vertex indices, nonnegative; vertices at one position must share one index.
    Returns False also when there is no triangle.
    """
    if len(triangles) == 0:
        return False
    closed = kernels.is_closed(triangles)
    if closed is not kernels.UNDECIDED:
        return closed
    _, edges = np.unique(edge_keys(triangles), return_inverse=True)
    rising = triangles < np.roll(triangles, -1, axis=1)
    return not np.bincount(edges, weights=np.where(rising, 1.0, -1.0).ravel()).any()


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed triangle surface, oriented outward, of one solid body.

    Attributes
    ----------
    points: (n, 3) in any length unit, each used by a triangle.
    triangles: (t, 3) counter-clockwise seen from outside.
    """

    points: Floats
    triangles: Integers

    @cached_property
    def _properties(self) -> tuple[float, Floats]:
        return solid_properties(self.points, self.triangles)

    @property
    def volume(self) -> float:
        """Volume of the uniform solid, in cubed length units."""
        return self._properties[0]

    @property
    def centroid(self) -> Floats:
        """(3,) center of mass of the uniform solid."""
        return self._properties[1]

    @cached_property
    def inertia(self) -> Floats:
        """(3, 3) tensor of inertia of the uniform solid about its centroid for a mass of 1, in
        squared length units; of a surface that may be oriented inward, but encloses a volume."""
        offsets = self.points - self.centroid
        scale = float(np.abs(offsets).max())
        moments, volume = second_moments(offsets / scale, self.triangles, np)
        moments = moments * (scale**2 / volume)
        inertia: Floats = np.trace(moments) * np.eye(3) - moments
        return inertia

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the box along the axes that holds the surface."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def centroid_derivatives(self) -> Floats:
        """(3, n, 3) derivative of each coordinate of the centroid by each coordinate of the points
        (eq. 34)."""
        corners = self.points[self.triangles] - self.centroid
        lifts = np.linalg.cross(np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)) / 6.0
        volumes = (corners[:, 0] * lifts[:, 0]).sum(-1)
        means = corners.sum(axis=1) / 4.0
        by_corner = means[:, None, :, None] * lifts[:, :, None, :]
        by_corner += (volumes / 4.0)[:, None, None, None] * np.eye(3)
        by_corner = by_corner.reshape(-1, 3, 3)
        sums = sums_by_index(self.triangles.ravel(), by_corner, len(self.points))
        return np.ascontiguousarray(sums.transpose(1, 0, 2)) / volumes.sum()

    def reverse(self) -> Surface:
        """Surface with the other side outward."""
        return Surface(self.points, self.triangles[:, ::-1])

    def with_points(self, points: Floats) -> Surface:
        """Surface with these triangles between other points (n, 3)."""
        return Surface(points, self.triangles)


def surface_of(points: Floats, triangles: Integers) -> Surface:
    """Surface of triangles (t, 3), with those of the points (n, 3) that they use."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    return Surface(points[used], renumbered.reshape(-1, 3))


def join_surfaces(*surfaces: Surface) -> Surface:
    """Several surfaces as one."""
    starts = np.cumsum([0, *(len(each.points) for each in surfaces)])
    triangles = [each.triangles + start for each, start in zip(surfaces, starts, strict=False)]
    return Surface(np.concatenate([each.points for each in surfaces]), np.concatenate(triangles))
