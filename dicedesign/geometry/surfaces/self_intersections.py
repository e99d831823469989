"""Self-intersections of triangle surfaces: by overlapping boxes, separating planes, and then exact
signs."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.predicates import Orientation
from dicedesign.geometry.triangles import find_parts
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import FLAT_FOLD, ROUNDING, UNDERFLOW

EDGES = ((0, 1), (1, 2), (2, 0))
"""Corners at the ends of a triangle's edges."""


def intersecting_triangles(points: Floats, triangles: Integers) -> Integers:
    """Pairs of triangles that have more in common than the corners and edges they share.

    Two triangles that share no corner intersect when they have any point in common: they cross,
    touch, or overlap in one plane. Two that share one corner intersect when they have another
    point in common. Two that share an edge intersect when they are folded flat onto each other, to
    an angle of `FLAT_FOLD`; two with equal corners always do. So triangles side by side in
    one plane do not intersect. All but the folding is decided without rounding. Triangles without
    area are left out: what crosses them crosses their neighbors.

    Parameters
    ----------
    points: (n, 3) finite, distinct positions.
    triangles: (t, 3) indices into `points`; the surface may be open and wound in any way.

    Returns
    -------
    (m, 2) indices of triangles, the smaller first, in order.
    """
    signs = Orientation(points)
    whole = np.flatnonzero(_projection(triangles, points, signs) >= 0)
    corners = points[triangles[whole]]
    pairs = whole[overlapping_boxes(corners.min(axis=1), corners.max(axis=1))]
    first, second = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    same = first[:, :, None] == second[:, None, :]
    in_first, in_second = same.any(axis=2), same.any(axis=1)
    common = in_first.sum(axis=1)
    meet = common == 3

    edge = np.flatnonzero(common == 2)
    one = _rotate_corners(first[edge], in_first[edge].argmin(axis=1))
    other = _rotate_corners(second[edge], in_second[edge].argmin(axis=1))
    start = points[one[:, 1]]
    along = points[one[:, 2]] - start
    up, over = (np.cross(along, points[corner[:, 0]] - start) for corner in (one, other))
    cosine, sine = (up * over).sum(axis=1), np.linalg.norm(np.cross(up, over), axis=1)
    meet[edge] = (cosine > 0.0) & (sine <= FLAT_FOLD * cosine)

    corner = np.flatnonzero(common == 1)
    one = _rotate_corners(first[corner], in_first[corner].argmax(axis=1))
    other = _rotate_corners(second[corner], in_second[corner].argmax(axis=1))
    meet[corner] = _meet(one, other, 1, points, signs)
    apart = np.flatnonzero(common == 0)
    meet[apart] = _meet(first[apart], second[apart], 0, points, signs)
    return pairs[meet]


def intersection_groups(triangles: Integers, pairs: Integers) -> list[Integers]:
    """Triangles that intersect others, in groups connected by intersections or corners.

    triangles: (t, 3); pairs: (m, 2) as from `intersecting_triangles`. Returns the rising indices of
    the triangles of each group, largest group first.
    """
    involved, members = np.unique(pairs, return_inverse=True)
    used, corners = np.unique(triangles[involved], return_inverse=True)
    first, second = members.reshape(-1, 2).T
    count = len(involved)
    tails = np.concatenate((first, np.repeat(np.arange(count), 3)))
    heads = np.concatenate((second, count + corners.ravel()))
    group = find_parts(tails, heads, count + len(used))[:count]
    groups = [involved[group == k] for k in np.unique(group)]
    return sorted(groups, key=len, reverse=True)


def _rotate_corners(triangles: Integers, column: Integers) -> Integers:
    """Triangles (m, 3) turned so that they begin with their corner of that column (m,)."""
    return np.take_along_axis(triangles, (column[:, None] + np.arange(3)) % 3, axis=1)


def _projection(triangles: Integers, points: Floats, signs: Orientation) -> Integers:
    """(t,) the coordinate that leaves the projected triangle the largest area when dropped; -1 for
    a triangle without area."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    ranked = np.argsort(-np.abs(np.cross(b - a, c - a)), axis=1, kind="stable")
    chosen = np.full(len(triangles), -1)
    for axis in ranked.T:
        left = np.flatnonzero(chosen < 0)
        has_area = signs.in_plane(axis[left], *triangles[left].T) != 0
        chosen[left[has_area]] = axis[left[has_area]]
    return chosen


def _meet(
    first: Integers, second: Integers, common: int, points: Floats, signs: Orientation
) -> Booleans:
    """True (m,) where triangles (m, 3) with area have more in common than their first corner.

    common: 1 if they share their first corner and no other, 0 if they share none.
    """
    meet = np.zeros(len(first), dtype=bool)
    near = close_pairs(points[first], points[second], common)
    sides: list[Integers] = []
    for planes, others in ((first, second), (second, first)):
        # Of the corners that are not common: on which side of the other's plane they are.
        corners = others[near].T[common:]
        side = np.stack([signs.in_space(corner, *planes[near].T) for corner in corners], axis=1)
        reaches = (side.min(axis=1) <= 0) & (side.max(axis=1) >= 0)
        near, sides = near[reaches], [*(earlier[reaches] for earlier in sides), side[reaches]]
    above, below = sides
    first, second = first[near], second[near]
    meet[near] = _pierces(first, second, above, signs) | _pierces(second, first, below, signs)
    flat = (above == 0).all(axis=1)
    meet[near[flat]] = _overlap(first[flat], second[flat], common, points, signs)
    return meet


def _pierces(
    planes: Integers, triangles: Integers, sides: Integers, signs: Orientation
) -> Booleans:
    """True (m,) where an edge of the second triangles meets the first, other than in their plane.

    Where triangles do not lie in one plane, what they have in common is a segment with ends on such
    edges. Of triangles with a common corner only the edges opposite to it count.

    sides: (m, 3 or 2) of the planes, on which corners of the second triangles are that are not
    common.
    """
    meet = np.zeros(len(planes), dtype=bool)
    common = 3 - sides.shape[1]
    for start, end in EDGES[1:2] if common else EDGES:
        ends = sides[:, start - common], sides[:, end - common]
        chosen = np.flatnonzero((ends[0] * ends[1] <= 0) & (ends[0] != ends[1]) & ~meet)
        plane, tail, head = planes[chosen], triangles[chosen, start], triangles[chosen, end]
        turns = np.stack(
            [signs.in_space(plane[:, k], tail, head, plane[:, k - 1]) for k in range(3)]
        )
        meet[chosen] = (turns.min(axis=0) >= 0) | (turns.max(axis=0) <= 0)
    return meet


def _overlap(
    first: Integers, second: Integers, common: int, points: Floats, signs: Orientation
) -> Booleans:
    """True (m,) where triangles of one plane have more in common than their first corner.

    They do unless the line of an edge of one has the other strictly beyond it. Where they share
    their first corner, only edges at that corner count, and not what else the other has on their
    line if that lies behind the corner: it is then strictly beyond the other such edge.
    """
    dropped = _projection(first, points, signs)
    apart = np.zeros(len(first), dtype=bool)
    for one, other in ((first, second), (second, first)):
        turn = signs.in_plane(dropped, *one.T)
        edges = EDGES[::2] if common else EDGES
        sides = np.array(
            [
                [turn * signs.in_plane(dropped, one[:, a], one[:, b], corner) for a, b in edges]
                for corner in other.T[common:]
            ]
        )
        beyond = sides < 0
        if common:
            beyond |= (sides == 0) & beyond[:, ::-1]
        apart |= beyond.all(axis=0).any(axis=0)
    return ~apart


def overlapping_boxes(lower: Floats, upper: Floats) -> Integers:
    """Pairs of boxes along the axes of coordinates that have a point in common.

    The boxes are halved at the median of their middles along the longest axis, again and again,
    into a complete binary tree; its nodes are met with each other level by level. Boxes of a
    triangle surface take O(n log n) time, whatever their sizes.

    lower, upper: (n, 3) the corners, lower <= upper. Returns (m, 2) pairs i < j, in order.
    """
    count = len(lower)
    # Leaves beyond the number of boxes are empty: their box overlaps none.
    size = 1 << max(count - 1, 0).bit_length()
    low = np.full((size, 3), np.inf)
    high = np.full((size, 3), -np.inf)
    low[:count], high[:count] = lower, upper
    middles = np.full((size, 3), np.inf)
    middles[:count] = lower + 0.5 * (upper - lower)
    order = np.arange(size)
    nodes = 1
    while nodes < size:
        inside = order.reshape(nodes, -1)
        extent = high[inside].max(axis=1) - low[inside].min(axis=1)
        keys = middles[inside, extent.argmax(axis=1)[:, None]]
        order = np.take_along_axis(inside, keys.argsort(axis=1, kind="stable"), axis=1).ravel()
        nodes *= 2
    levels = [(low[order], high[order])]
    while len(levels[0][0]) > 1:
        below, above = levels[0]
        levels.insert(0, (np.minimum(below[::2], below[1::2]), np.maximum(above[::2], above[1::2])))
    first = second = np.zeros(1, dtype=np.int64)
    for low, high in levels[1:]:
        apart = first != second
        left, right = (2 * first, 2 * first[apart]), (2 * second, 2 * second[apart])
        first = np.concatenate((left[0], left[0] + 1, left[0], left[1] + 1))
        second = np.concatenate((right[0], right[0] + 1, right[0] + 1, right[1]))
        for axis in range(3):
            meet = (low[first, axis] <= high[second, axis]) & (
                low[second, axis] <= high[first, axis]
            )
            first, second = first[meet], second[meet]
    first, second = first[first != second], second[first != second]
    pairs = np.sort(np.stack((order[first], order[second]), axis=1), axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def close_pairs(first: Floats, second: Floats, common: int) -> Integers:
    """The pairs of triangles of which rounding lets no plane say that they are apart.

    Triangles are apart when all corners of one lie strictly above all of the other, or, where they
    share their first corner, above that corner and the others of the other below it.

    first, second: (m, 3, 3) corners of triangles with area; common: 1 if they share their first
    corners, 0 if they share none. Returns indices of pairs, rising.
    """
    close = np.arange(len(first))
    for part in range(8 if common == 0 else 1):
        one, other = first[close], second[close]
        if common:
            # Between those two edges at the common corner that are nearest to each other.
            edges = [corners[:, 1:] - corners[:, :1] for corners in (one, other)]
            a, b = (edge / np.linalg.norm(edge, axis=2, keepdims=True) for edge in edges)
            nearest = (a[:, :, None] * b[:, None]).sum(axis=3).reshape(-1, 4).argmax(axis=1)
            rows = np.arange(len(one))
            axis = b[rows, nearest % 2] - a[rows, nearest // 2]
        else:
            # The normals, then in the planes the directions across the edges.
            corners = (one, other)[part % 2]
            axis = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            if part >= 2:
                edge = part // 2 - 1
                axis = np.cross(axis, corners[:, edge] - corners[:, edge - 1])
        products = [(c - one[:, :1])[:, common:] * axis[:, None] for c in (one, other)]
        error = ROUNDING * np.abs(products).sum(axis=-1).max(axis=(0, 2)) + UNDERFLOW
        ones, others = (product.sum(axis=2) for product in products)
        if common:
            apart = (ones.max(axis=1) < -error) & (others.min(axis=1) > error)
        else:
            apart = others.min(axis=1) - ones.max(axis=1) > 2 * error
            apart |= ones.min(axis=1) - others.max(axis=1) > 2 * error
        close = close[~apart]
    return close
