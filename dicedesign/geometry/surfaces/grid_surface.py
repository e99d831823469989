"""Distances from a surface, depths inside it on a cubic grid, surfaces between inner and outer
nodes of a grid, and their smoothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.spatial.distance import cdist

from dicedesign.geometry.sphere import norms
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges, sums_by_index

PAIRS_AT_ONCE: Final = 2_000_000
"""Pairs of a point and a triangle that are compared at a time, to bound the memory."""


def distances_from_surface(surface: Surface, points: Floats) -> Floats:
    """(k,) distances of points (k, 3) from a surface, in its unit of length."""
    triangles, weights = closest_points(surface, points)
    feet = (weights[:, :, None] * surface.points[surface.triangles[triangles]]).sum(1)
    return norms(feet - points)


def closest_points(surface: Surface, points: Floats) -> tuple[Integers, Floats]:
    """Closest points of a surface to points (k, 3): the triangle (k,) of each, and the weights
    (k, 3) of its corners, not negative and of sum 1. Of equally close triangles, the first."""
    corners = surface.points[surface.triangles]
    triangles = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), 3))
    for query, triangle in _near_pairs(corners, points):
        inside = _closest_in_triangles(points[query], corners[triangle])
        feet = (inside[:, :, None] * corners[triangle]).sum(1)
        order = np.lexsort((triangle, norms(feet - points[query]), query))
        queried, first = np.unique(query[order], return_index=True)
        triangles[queried], weights[queried] = triangle[order[first]], inside[order[first]]
    return triangles, weights


def _near_pairs(corners: Floats, points: Floats) -> Iterator[tuple[Integers, Integers]]:
    """Pairs of a point (k, 3) and a triangle (t, 3, 3), among them each point's closest triangle;
    all pairs of a point come together.

    A triangle is left out if its bounding sphere is farther away than the far side of another
    triangle's.
    """
    centers = corners.mean(axis=1)
    radii = norms(corners - centers[:, None]).max(axis=1)
    rows = max(1, PAIRS_AT_ONCE // len(centers))
    for first in range(0, len(points), rows):
        distances = cdist(points[first : first + rows], centers)
        # Each triangle has a point at most this far, and none nearer than the other.
        bound = (distances + radii).min(axis=1)
        query, triangle = np.nonzero(distances - radii <= bound[:, None])
        yield first + query, triangle


def _closest_in_triangles(points: Floats, corners: Floats) -> Floats:
    """(m, 3) weights of the corners of triangles (m, 3, 3) whose mean is closest to points (m,
    3)."""
    # The foot of the perpendicular onto the plane, where it is inside and the triangle has area.
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    normal = np.linalg.cross(opposite[:, 1], opposite[:, 2])
    squared = (normal * normal).sum(-1)
    arms = points[:, None] - np.roll(corners, -1, axis=1)
    weights = (np.linalg.cross(opposite, arms) * normal[:, None]).sum(-1)
    inside = (squared > 0.0) & (weights >= 0.0).all(axis=1)
    weights = weights / np.where(squared > 0.0, squared, 1.0)[:, None]
    squares = np.where(inside, _squares(weights, corners, points), np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, end] - corners[:, start]
        length = (edge * edge).sum(-1)
        along = ((points - corners[:, start]) * edge).sum(-1)
        part = np.clip(along / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        beside = np.zeros_like(weights)
        beside[:, start], beside[:, end] = 1.0 - part, part
        square = _squares(beside, corners, points)
        nearer = square < squares
        weights = np.where(nearer[:, None], beside, weights)
        squares = np.minimum(squares, square)
    return weights


def _squares(weights: Floats, corners: Floats, points: Floats) -> Floats:
    offsets = (weights[:, :, None] * corners).sum(1) - points
    return np.asarray((offsets * offsets).sum(-1))


LATTICE_OFFSET: Final = (np.sqrt(0.3), np.sqrt(0.5), np.sqrt(0.7))
"""Steps from the first nodes to the lowest coordinates of a surface, along each axis, irrational so
that nodes are seldom on the surface."""


@dataclass(frozen=True, eq=False)
class DepthGrid:
    """A cubic grid about a surface.

    Attributes
    ----------
    corner: (3,) the first node.
    spacing: between nodes.
    depths: (a, b, c) of the nodes: distance from the surface inside, and its negative outside,
        where it is -inf but for nodes next to one inside. All on the border of the grid are
        outside.
    """

    corner: Floats
    spacing: float
    depths: Floats

    def places(self, nodes: Integers) -> Floats:
        """(m, 3) places of nodes (m, 3)."""
        return self.corner + self.spacing * nodes


def depth_grid(surface: Surface, steps: int) -> DepthGrid:
    """Depths inside a surface on a grid with a number of steps along its longest extent."""
    low, extent = surface.points.min(axis=0), np.ptp(surface.points, axis=0)
    spacing = float(extent.max()) / steps
    corner = low - spacing * np.array(LATTICE_OFFSET)
    shape = np.ceil(extent / spacing).astype(np.int64) + 2
    inside = _inside((surface.points - corner) / spacing, surface.triangles, shape)
    depths = np.full(inside.shape, -np.inf)
    near = binary_dilation(inside)
    distances = distances_from_surface(surface, corner + spacing * np.argwhere(near))
    depths[near] = np.where(inside[near], distances, -distances)
    return DepthGrid(corner, spacing, depths)


def _inside(points: Floats, triangles: Integers, shape: Integers) -> Booleans:
    """(a, b, c) whether nodes with whole coordinates are inside a closed surface, by the parity of
    its crossings along z."""
    corners = points[triangles]
    first = np.ceil(corners[..., :2].min(axis=1)).astype(np.int64)
    count = np.floor(corners[..., :2].max(axis=1)).astype(np.int64) - first + 1
    owner, place = ragged_ranges(np.zeros(len(corners), dtype=np.int64), count.clip(0).prod(axis=1))
    column = first[owner] + np.stack(np.divmod(place, count[owner, 1]), axis=-1)
    sides = []
    for k in range(3):
        # Sorted ends: both triangles of an edge put a column on one side of it.
        ends = np.sort(triangles[:, [k, (k + 1) % 3]], axis=1)
        tail = points[ends[owner, 0], :2]
        (x, y), (right, up) = (points[ends[owner, 1], :2] - tail).T, (column - tail).T
        sides.append((x * up - y * right >= 0.0) ^ (triangles[owner, k] != ends[owner, 0]))
    crossed = (sides[0] == sides[1]) & (sides[1] == sides[2])
    owner, column = owner[crossed], column[crossed]
    a, b, c = corners[owner].transpose(1, 0, 2)
    normal = np.linalg.cross(b - a, c - a)
    height = a[:, 2] - ((column - a[:, :2]) * normal[:, :2]).sum(-1) / normal[:, 2]
    node = np.ceil(np.clip(height, 0.0, shape[2] - 1.0)).astype(np.int64)
    crossings = np.zeros(tuple(shape.tolist()), dtype=np.int64)
    np.add.at(crossings, (*column.T, node), 1)
    return np.asarray(np.cumsum(crossings, axis=2) % 2 == 1)


AROUND: Final = ((0, 0), (-1, 0), (-1, -1), (0, -1))
"""Offsets of the four cells about an edge of the grid."""


def surface_nets(
    inside: Booleans, crossing: Callable[[Integers, Integers], Floats]
) -> tuple[Floats, Integers]:
    """A point for each cell that the surface passes through, at the mean of where it crosses the
    cell's edges, and two triangles for each edge that it crosses.

    Parameters
    ----------
    inside: (a, b, c) whether a node is; none on the border of the grid. Where a cell is cut twice
        (see `without_double_cuts`), sheets of the surface meet in its point.
    crossing: where the surface crosses edges, (m, 3), from their ends (m, 3) in steps of the grid.

    Returns
    -------
    Points (n, 3) in the coordinates of `crossing`, and triangles (t, 3) of a closed surface,
    oriented outward.

    Source: Gibson, Constrained elastic surface nets (MICCAI 1998), for the first step.
    """
    crossings, quads = [], []
    for axis in range(3):
        step = np.eye(3, dtype=np.int64)[axis]
        nodes = np.stack(np.nonzero(np.diff(inside, axis=axis)), axis=-1)
        crossings.append(crossing(nodes, nodes + step))
        # Counter-clockwise seen from the far end of the edge, which is outside where it leaves.
        offsets = np.roll([(0, i, j) for i, j in AROUND], axis, axis=1)
        cells = np.ravel_multi_index((nodes[:, None] + offsets).transpose(2, 0, 1), inside.shape)
        leaves = inside[tuple(nodes.T)]
        quads.append(np.where(leaves[:, None], cells, cells[:, ::-1]))
    # Numbered without gaps.
    corners = np.unique(np.concatenate(quads), return_inverse=True)[1].reshape(-1, 4)
    count = np.bincount(corners.ravel())
    crossed = np.concatenate(crossings).repeat(4, axis=0)
    points = sums_by_index(corners.ravel(), crossed, len(count)) / count[:, None]
    return points, np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def without_double_cuts(values: Floats) -> Booleans:
    """Nodes of a grid with values above 0, and as few others as needed so that their surface cuts
    no cell twice.

    A cell is cut twice where two nodes at opposite corners of one of its faces, or of the cell
    itself, are on one side and all others of that face, or cell, on the other. The outer node of
    largest value is then added, until no cell is cut twice: the surface is a manifold.

    Source: Latecki, 3D well-composed pictures (1997), for the condition.
    """
    cubes = []
    for axes in ((0, 1), (1, 2), (0, 2), (0, 1, 2)):
        corners = list(product(*((0, 1) if axis in axes else (0,) for axis in range(3))))
        # Each pair of opposite corners first and last.
        for near, far in zip(corners[: len(corners) // 2], corners[::-1], strict=False):
            others = [corner for corner in corners if corner not in (near, far)]
            cubes.append([near, *others, far])
    inside = values > 0.0
    while True:
        added = np.zeros_like(inside)
        for offsets in cubes:
            first, *between, last = (
                inside[
                    tuple(slice(d, d + n - 1) for d, n in zip(offset, inside.shape, strict=True))
                ]
                for offset in offsets
            )
            same = np.logical_or.reduce([corner == first for corner in between])
            cells = np.stack(np.nonzero((last == first) & ~same), axis=-1)
            nodes = cells[:, None] + np.array(offsets)
            places = tuple(nodes.transpose(2, 0, 1))
            outer = np.where(inside[places], -np.inf, values[places])
            chosen = nodes[np.arange(len(nodes)), outer.argmax(axis=1)]
            added[tuple(chosen.T)] = True
        if not added.any():
            return inside
        inside |= added


FLIP_PASSES: Final = 3
"""Most passes over all edges in each round."""

STEP: Final = 0.6
"""Share of the way to the middle of its neighbors by which a point is moved."""

EXCESS: Final = 1e-9
"""Angle, in radians, by which those opposite to an edge must exceed 180 degrees to flip it."""


def smooth_mesh(
    points: Floats, triangles: Integers, onto: Callable[[Floats, Integers], Floats], rounds: int
) -> tuple[Floats, Integers]:
    """Points and triangles of a closed surface, remeshed so that the triangles are more even.

    Points are moved toward the middle of their neighbors and back onto the surface, and edges are
    flipped until the angles opposite to each sum to no more than 180 degrees, in turns.

    Parameters
    ----------
    points, triangles: (n, 3) and (t, 3), of a closed oriented surface.
    onto: moves points (n, 3), joined by triangles (t, 3), onto the surface.
    rounds: number of turns.
    """
    for _ in range(rounds):
        triangles = _flip_edges(points, triangles)
        a, b, c = points[triangles].transpose(1, 0, 2)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
        weights = sums_by_index(triangles.ravel(), areas.repeat(3), len(points))
        moments = (areas[:, None] * points[triangles].mean(axis=1)).repeat(3, axis=0)
        middles = sums_by_index(triangles.ravel(), moments, len(points)) / weights[:, None]
        points = onto(points + STEP * (middles - points), triangles)
    return points, _flip_edges(points, triangles)


def _flip_edges(points: Floats, triangles: Integers) -> Integers:
    """Triangles with edges flipped where the angles opposite to an edge sum to more than 180
    degrees and the new edge does not exist yet."""
    triangles = triangles.copy()
    size = len(points)
    for _ in range(FLIP_PASSES):
        tail, head = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        forward = tail * size + head
        order = np.argsort(forward)
        twin = order[np.searchsorted(forward[order], head * size + tail)]
        apex = np.roll(triangles, -2, axis=1).ravel()
        a, b = points[tail] - points[apex], points[head] - points[apex]
        angles = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))
        excess = angles + angles[twin] - np.pi
        candidates = np.flatnonzero((excess > EXCESS) & (tail < head))
        if not len(candidates):
            break
        edges = set(forward.tolist())
        touched: set[int] = set()
        for half in candidates[np.argsort(-excess[candidates], kind="stable")].tolist():
            other = int(twin[half])
            one, two = half // 3, other // 3
            p, q = int(apex[half]), int(apex[other])
            if one in touched or two in touched or p * size + q in edges:
                continue
            touched |= {one, two}
            edges |= {p * size + q, q * size + p}
            triangles[one] = p, tail[half], q
            triangles[two] = q, head[half], p
    return triangles


MOST: Final = 300
"""Most pairs of triangles that meet for which untangling is tried."""

ROUNDS: Final = 8
"""Most searches for triangles that meet."""

SMOOTHINGS: Final = 3
"""Moves of points after each search."""

RINGS: Final = 1
"""Rings of neighbors that are moved with the points of triangles that meet."""


def untangle(surface: Surface) -> Surface | None:
    """Surface whose points around triangles that meet are smoothed, ever wider, until no two meet;
    None if some still do after `ROUNDS`."""
    points, triangles = surface.points.copy(), surface.triangles
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    near = np.zeros(len(points), dtype=bool)
    for _ in range(ROUNDS):
        pairs = intersecting_triangles(points, triangles)
        if len(pairs) == 0:
            return surface.with_points(points)
        if len(pairs) > MOST:
            break
        near[triangles[pairs]] = True
        for _ in range(RINGS):
            near[heads[near[tails]]] = True
        # Each edge of a closed surface is there once each way.
        edges = np.flatnonzero(near[tails])
        count = np.bincount(tails[edges], minlength=len(points))[near]
        for _ in range(SMOOTHINGS):
            sums = sums_by_index(tails[edges], points[heads[edges]], len(points))[near]
            points[near] = sums / count[:, None]
    return None
