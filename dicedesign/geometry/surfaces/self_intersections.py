"""Places where a triangle surface meets itself."""

from __future__ import annotations

import numpy as np

from dicedesign.geometry.predicates import Orientation
from dicedesign.geometry.surfaces.box_tree import overlapping_boxes
from dicedesign.geometry.surfaces.separating_planes import close_pairs
from dicedesign.geometry.triangles import connected_parts
from dicedesign.runtime.arrays import Booleans, Floats, Integers
from dicedesign.tolerances import FLAT_FOLD

__all__ = ["intersecting_triangles", "intersection_groups"]


def intersecting_triangles(points: Floats, triangles: Integers) -> Integers:
    """Pairs of triangles that have more in common than the corners and edges they share.

    Two triangles that share no corner intersect when they have any point in common: they cross,
    touch, or overlap in one plane. Two that share one corner intersect when they have another
    point in common. Two that share an edge intersect when they are folded flat onto each other, to
    an angle of `FLAT_FOLD`; two with the same three corners always do. So triangles side by side in
    one plane do not intersect, be they ever so many.
    All but the folding is decided without rounding. Triangles without area are left out: what
    crosses them crosses their neighbors.

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
    meet[edge] = _folded_flat(
        _from(first[edge], in_first[edge].argmin(axis=1)),
        _from(second[edge], in_second[edge].argmin(axis=1)),
        points,
    )
    corner = np.flatnonzero(common == 1)
    meet[corner] = _meet(
        _from(first[corner], in_first[corner].argmax(axis=1)),
        _from(second[corner], in_second[corner].argmax(axis=1)),
        1,
        points,
        signs,
    )
    apart = np.flatnonzero(common == 0)
    meet[apart] = _meet(first[apart], second[apart], 0, points, signs)
    return pairs[meet]


def intersection_groups(triangles: Integers, pairs: Integers) -> list[Integers]:
    """Triangles that intersect others, in groups that hang together by intersections or corners.

    triangles: (t, 3); pairs: (m, 2) as from `intersecting_triangles`. Returns the rising indices of
    the triangles of each group, largest group first.
    """
    involved, members = np.unique(pairs, return_inverse=True)
    used, corners = np.unique(triangles[involved], return_inverse=True)
    first, second = members.reshape(-1, 2).T
    count = len(involved)
    tails = np.concatenate((first, np.repeat(np.arange(count), 3)))
    heads = np.concatenate((second, count + corners.ravel()))
    group = connected_parts(tails, heads, count + len(used))[:count]
    groups = [involved[group == k] for k in np.unique(group)]
    return sorted(groups, key=len, reverse=True)


def _from(triangles: Integers, column: Integers) -> Integers:
    """Triangles (m, 3) turned so that they begin with their corner of that column (m,)."""
    return np.take_along_axis(triangles, (column[:, None] + np.arange(3)) % 3, axis=1)


def _projection(triangles: Integers, points: Floats, signs: Orientation) -> Integers:
    """(t,) a coordinate that can be dropped without making the triangle flat, the best one as far
    as rounding tells; -1 for a triangle without area."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    ranked = np.argsort(-np.abs(np.cross(b - a, c - a)), axis=1, kind="stable")
    chosen = np.full(len(triangles), -1)
    for axis in ranked.T:
        left = np.flatnonzero(chosen < 0)
        has_area = signs.in_plane(axis[left], *triangles[left].T) != 0
        chosen[left[has_area]] = axis[left[has_area]]
    return chosen


def _folded_flat(first: Integers, second: Integers, points: Floats) -> Booleans:
    """True (m,) where triangles (m, 3) that share all corners but their first lie on each other."""
    start = points[first[:, 1]]
    edge = points[first[:, 2]] - start
    one, other = (np.cross(edge, points[corner[:, 0]] - start) for corner in (first, second))
    along = (one * other).sum(axis=1)
    return (along > 0.0) & (np.linalg.norm(np.cross(one, other), axis=1) <= FLAT_FOLD * along)


def _meet(
    first: Integers, second: Integers, common: int, points: Floats, signs: Orientation
) -> Booleans:
    """True (m,) where triangles (m, 3) with area have more in common than their first corner.

    common: 1 if they share their first corner and no other, 0 if they share none.
    """
    meet = np.zeros(len(first), dtype=bool)
    near = close_pairs(points[first], points[second], common)
    above = _sides(first[near], second[near], common, signs)
    kept = _reaches(above)
    near, above = near[kept], above[kept]
    below = _sides(second[near], first[near], common, signs)
    kept = _reaches(below)
    near, above, below = near[kept], above[kept], below[kept]
    first, second = first[near], second[near]
    meet[near] = _pierces(first, second, above, signs) | _pierces(second, first, below, signs)
    flat = (above == 0).all(axis=1)
    meet[near[flat]] = _overlap(first[flat], second[flat], common, points, signs)
    return meet


def _sides(planes: Integers, triangles: Integers, common: int, signs: Orientation) -> Integers:
    """(m, 3 - common) the sides of planes on which the corners of triangles lie that are not
    common."""
    corners = triangles.T[common:]
    return np.stack([signs.in_space(corner, *planes.T) for corner in corners], axis=1)


def _reaches(sides: Integers) -> Booleans:
    """True (m,) where not all corners lie strictly on one side."""
    return (sides.min(axis=1) <= 0) & (sides.max(axis=1) >= 0)


def _pierces(
    planes: Integers, triangles: Integers, sides: Integers, signs: Orientation
) -> Booleans:
    """True (m,) where an edge of the second triangles meets the first, other than in their plane.

    Where triangles do not lie in one plane, what they have in common is a segment with ends on such
    edges. Of triangles with a common corner only the edges opposite to it count.

    sides: of the corners of the second triangles, as from `_sides`.
    """
    meet = np.zeros(len(planes), dtype=bool)
    common = 3 - sides.shape[1]
    for start, end in ((1, 2),) if common else ((0, 1), (1, 2), (2, 0)):
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
        edges = ((0, 1), (2, 0)) if common else ((0, 1), (1, 2), (2, 0))
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
