"""Ways to read a die, and the parts of facets that their labels are on.

Labels are on the facet that the die rests on, on the level facet on top, around the corner on top,
as on a tetrahedron, or on both sides of the edge on top.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dicedesign.errors import EngravingError
from dicedesign.fabricate.numbering import opposite_facets
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.results.parts import READINGS
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import LEVEL_ANGLE

PEAK = 0.05
"""Least height of a top corner above all others, over the die's height."""

RISE = 0.1
"""Least cosine between a facet's normal and up at which the facet is readable from above."""

TAPER = 0.85
"""Longest side of a corner region of a facet, over its base, which is below the label."""

ROUNDING = 1e-9
"""Distance over the extent of a facet at which a line runs through its corner."""

ALL_AROUND = 4
"""Number of facets and outcomes of a tetrahedron."""


@dataclass(frozen=True, eq=False)
class LabelPlace:
    """Label and its region on the hull.

    Attributes
    ----------
    text: the label; outcome: its number.
    facet: of the hull; region: (m, 3) corners of the label's part of it, convex, counter-clockwise
        seen from outside; the longest edge of a corner region is below the label.
    normal: (3,) outward unit normal of the facet.
    up: (3,) direction in which the label is upright, or None for the one that suits the region.
    """

    text: str
    outcome: int
    facet: int
    region: Floats
    normal: Floats
    up: Floats | None = None


@dataclass(frozen=True, eq=False)
class Reading:
    """Way to read a die: from which side, and where the labels are.

    Attributes
    ----------
    way: "down", "up" or "both" for labels on facets below, on top or both, "corner" for those
        around the corner on top, "edge" for those on both sides of the edge on top, or on the facet
        where that is level, or "marks" for the upper side of a concave die.
    places: of the labels, in the order of the outcomes; none with "marks".
    """

    way: str
    places: tuple[LabelPlace, ...] = ()

    @property
    def sentence(self) -> str:
        """Instruction for the reader of the die."""
        return READINGS[self.way]


def die_readings(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], read: str
) -> tuple[Reading, ...]:
    """Ways to read a die with their label places, the best first; the next one is for labels that
    do not fit.

    Parameters
    ----------
    hull: of the die.
    facets: (k,) facet that it rests on in each outcome.
    labels: k texts.
    read: "down"; "up", on level facets on top, or else around corners or beside edges on top;
        "both", below and on level facets on top; or "auto": up if all facets on top are level, the
        die is a tetrahedron or edges are on top of the others, and then down.

    Raises
    ------
    EngravingError: the die cannot be read in this way; the message names an outcome and its top.
    """

    def on_facets(way: str, *sides: Integers) -> Reading:
        """Labels on whole facets, of which each outcome has one in each of the sides (k,)."""
        return _reading(
            way,
            labels,
            hull,
            [
                (outcome, facet, hull.polygon(facet))
                for outcome, own in enumerate(np.stack(sides, axis=1).tolist())
                for facet in own
            ],
        )

    below = on_facets("down", facets)
    if read == "down":
        return (below,)
    level, above = opposite_facets(hull, facets), None
    leans = np.degrees(
        angle_between(-hull.normals[facets][:, None], hull.normals[None]).min(axis=1)
    )
    without = [f"one that leans by {lean:.0f} degrees" for lean in leans]
    flaw = _flaw(facets, labels, level, "level facet", read, without)
    if not flaw:
        above = on_facets("both", facets, level) if read == "both" else on_facets("up", level)
    elif read != "both":
        corners = np.array([_top_corner(hull, facet) for facet in facets.tolist()])
        without = ["none seen from above"] * len(facets)
        other = _flaw(facets, labels, corners, "corner", read, without)
        if not other and (read == "up" or len(facets) == len(hull.normals) == ALL_AROUND):
            above = _around_corners(hull, labels, corners, facets)
        else:
            above = _beside_edges(hull, labels, facets, level)
        if (corners >= 0).sum() > (level >= 0).sum():
            flaw = other
    if read == "auto":
        return (below,) if above is None else (above, below)
    if above is None:
        raise EngravingError(flaw)
    return (above,)


def _flaw(
    facets: Integers,
    labels: Sequence[str],
    on_top: Integers,
    what: str,
    read: str,
    without: Sequence[str],
) -> str:
    """Sentence about the first outcome with nothing (k,) of its own on top of it, or "".

    what: is expected on top; without: k descriptions of a top without it.
    """
    for outcome, top in enumerate(on_top.tolist()):
        is_same = on_top == top
        if read == "both":
            is_same |= facets == top
        is_same[outcome] = False
        if top < 0:
            got = without[outcome]
        elif is_same.any():
            got = f"one that {labels[int(is_same.argmax())]!r} has too"
        else:
            continue
        return (
            f"read: expected a {what} of its own on top of each outcome for {read}, got {got} on "
            f"top of {labels[outcome]!r}; write read: down, or leave read out"
        )
    return ""


def _reading(
    way: str,
    labels: Sequence[str],
    hull: ConvexHull,
    regions: Sequence[tuple[int, int, Floats]],
) -> Reading:
    """Reading of labels in regions: the outcome, the facet, and the corners (m, 3) of each."""
    places = (
        LabelPlace(labels[outcome], outcome, facet, region, hull.normals[facet])
        for outcome, facet, region in regions
    )
    return Reading(way, tuple(places))


def _around_corners(
    hull: ConvexHull, labels: Sequence[str], corners: Integers, facets: Integers
) -> Reading:
    """Labels on all facets around the top corner (k,) of a die that rests on a facet (k,)."""
    regions = [
        (outcome, int(hull.facet[half_edge]), _corner_region(hull, half_edge))
        for outcome, (corner, below) in enumerate(zip(corners, facets, strict=True))
        for half_edge in _leaving(hull, corner)
        if hull.facet[half_edge] != below
    ]
    return _reading("corner", labels, hull, regions)


def _beside_edges(
    hull: ConvexHull, labels: Sequence[str], facets: Integers, level: Integers
) -> Reading | None:
    """Labels on both sides of the edge on top of a die that rests on a facet (k,), or on its facet
    on top (k,) where one is level; None if an outcome has neither of its own."""
    edges = np.array([_top_edge(hull, facet) for facet in facets.tolist()])
    edges[level >= 0] = -1
    sides = np.concatenate([edges[edges >= 0], hull.twin[edges[edges >= 0]]])
    on_top = [*level[level >= 0].tolist(), *hull.facet[sides].tolist()]
    is_shared = len(np.unique(sides)) < len(sides) or any(
        on_top.count(top) > 1 for top in level[level >= 0].tolist()
    )
    if ((edges < 0) & (level < 0)).any() or is_shared:
        return None
    places = []
    for outcome, (edge, top) in enumerate(zip(edges.tolist(), level.tolist(), strict=True)):
        if edge < 0:
            region, normal = hull.polygon(top), hull.normals[top]
            places.append(LabelPlace(labels[outcome], outcome, top, region, normal))
            continue
        for side in (edge, int(hull.twin[edge])):
            facet = int(hull.facet[side])
            start, inward = _side_line(hull, side)
            region = hull.polygon(facet)
            # Nearer to the edge than to the far end, and than to other edges with labels.
            region = _cut(region, inward, float((region @ inward).max() + start @ inward) / 2.0)
            for other in sides[(hull.facet[sides] == facet) & (sides != side)].tolist():
                end, away = _side_line(hull, other)
                region = _cut(region, inward - away, float(start @ inward - end @ away))
            places.append(
                LabelPlace(labels[outcome], outcome, facet, region, hull.normals[facet], -inward)
            )
    return Reading("edge", tuple(places))


def _side_line(hull: ConvexHull, half_edge: int) -> tuple[Floats, Floats]:
    """Start (3,) of a half-edge, and unit direction (3,) from it into its facet."""
    start, end = hull.vertices[[hull.tail[half_edge], hull.head[half_edge]]]
    inward = np.cross(hull.normals[hull.facet[half_edge]], end - start)
    return start, inward / np.linalg.norm(inward)


def _cut(polygon: Floats, direction: Floats, most: float) -> Floats:
    """Part (n, 3) of a convex polygon (m, 3) that is at most so far in a direction (3,)."""
    beyond = polygon @ direction - most
    beyond[np.abs(beyond) <= ROUNDING * np.ptp(polygon)] = 0.0
    corners = []
    for k, (corner, over) in enumerate(zip(polygon, beyond.tolist(), strict=True)):
        before, under = polygon[k - 1], float(beyond[k - 1])
        if over * under < 0.0:
            corners.append(before + (corner - before) * under / (under - over))
        if over <= 0.0:
            corners.append(corner)
    return np.array(corners)


def _top_edge(hull: ConvexHull, facet: int) -> int:
    """Half-edge of the level edge on top of a die that rests on a facet, or -1 if there is none
    whose two facets are readable from above."""
    up = -hull.normals[facet]
    heights = hull.vertices @ up
    *_, third, second, top = np.argsort(heights, kind="stable").tolist()
    length = float(np.linalg.norm(hull.vertices[top] - hull.vertices[second]))
    is_level = heights[top] - heights[second] <= np.sin(LEVEL_ANGLE) * length
    if not is_level or heights[second] - heights[third] < PEAK * np.ptp(heights):
        return -1
    around = _leaving(hull, top)
    edge = int(around[hull.head[around] == second][0])
    both = hull.facet[[edge, hull.twin[edge]]]
    return edge if (hull.normals[both] @ up >= RISE).all() else -1


def _leaving(hull: ConvexHull, corner: int) -> Integers:
    start, half_edges = hull.outgoing
    return half_edges[start[corner] : start[corner + 1]]


def _corner_region(hull: ConvexHull, half_edge: int) -> Floats:
    """Region (m, 3) of a facet at the corner that its half-edge leaves: as wide as half of the
    distance to the nearest corner, with its tip cut off so that its base is its longest edge. The
    regions of a facet are disjoint."""
    corner = hull.vertices[hull.tail[half_edge]]
    others = hull.polygon(int(hull.facet[half_edge])) - corner
    reach = 0.5 * float(np.sort(norms(others))[1])
    ends = [hull.head[half_edge], hull.tail[hull.previous[half_edge]]]
    sides = hull.vertices[ends] - corner
    right, left = reach * sides / norms(sides)[:, None]
    # The base is twice this sine times a whole side.
    sine = float(norms(right - left)) / (2.0 * reach)
    tip = 1.0 - 2.0 * TAPER * sine
    if tip <= 0.0:
        return np.stack([corner, corner + right, corner + left])
    return corner + np.stack([tip * right, right, left, tip * left])


def _top_corner(hull: ConvexHull, facet: int) -> int:
    """Top corner of a die that rests on a facet, or -1 if there is none whose facets are all
    readable from above."""
    up = -hull.normals[facet]
    heights = hull.vertices @ up
    *_, second, top = np.argsort(heights, kind="stable").tolist()
    if heights[top] - heights[second] < PEAK * np.ptp(heights):
        return -1
    around = hull.facet[_leaving(hull, top)]
    return top if (hull.normals[around] @ up >= RISE).all() else -1
