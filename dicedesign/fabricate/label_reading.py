"""How a die is read, and where its labels go for that.

A label lies on the facet that the die rests on, on the one that is level on top then, or around the
corner that is on top, upright toward it, as on a tetrahedron.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import LEVEL_ANGLE

if TYPE_CHECKING:
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.rest.poses import RestPoses


def opposite_facets(hull: ConvexHull, facets: Integers) -> Integers:
    """(k,) facets of a hull that are level on top while it rests on facets (k,), or -1 where the
    nearest to that leans by more than `LEVEL_ANGLE`."""
    angles = angle_between(-hull.normals[facets][:, None], hull.normals[None])
    nearest = angles.argmin(axis=1)
    level = angles[np.arange(len(facets)), nearest] <= LEVEL_ANGLE
    return np.where(level, nearest, -1)


PEAK: Final = 0.05
"""A corner is on top where it is higher than all others by this part of the die's height."""

RISE: Final = 0.1
"""Cosine of the angle to the upright up to which a facet's normal leans where the facet is read
from above."""

TAPER: Final = 0.85
"""Longest side of a corner's part of a facet, over its base, which is below the label."""

ALL_AROUND: Final = 4
"""Facets and outcomes of a tetrahedron."""


@dataclass(frozen=True, eq=False)
class LabelPlace:
    """A label and where on the hull it goes.

    Attributes
    ----------
    text: the label; outcome: its number.
    facet: of the hull; region: (m, 3) corners of the part of it that is the label's, convex,
        counter-clockwise seen from outside; where that is a part only, its longest edge is to be
        below the label.
    normal: (3,) outward unit normal of the facet.
    """

    text: str
    outcome: int
    facet: int
    region: Floats
    normal: Floats


@dataclass(frozen=True, eq=False)
class Reading:
    """How a die is read.

    Attributes
    ----------
    way: "down", "up" or "both" with labels on facets below, on top or on both, "corner" around the
        corner on top, or "marks" in the upper side of a die that keeps the shape of a surface.
    sentence: for who throws it.
    places: of the labels, in the order of the outcomes; none with "marks".
    """

    way: str
    sentence: str
    places: tuple[LabelPlace, ...]


SENTENCES: Final = {
    "down": "Lift the die: the label on the facet that lay on the table counts.",
    "up": "Read the label on top.",
    "both": "Read the label on top; the one that lies on the table is the same.",
    "corner": "Read the label that stands upright around the top corner.",
    "marks": "Read the label on the side that is up.",
}

MARKED: Final = Reading("marks", SENTENCES["marks"], ())
"""Of every die that keeps the shape of a surface."""


def die_readings(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], read: str
) -> tuple[Reading, ...]:
    """How a die may be read and where its labels go then, the best first; each is tried where the
    labels have no room in the one before.

    Parameters
    ----------
    hull: of the die.
    facets: (k,) facet that it rests on in each outcome.
    labels: k texts.
    read: "down"; "up", on level facets on top, or else around corners on top; "both", below and on
        level facets on top; or "auto": up where all facets on top are level or the die is a
        tetrahedron, and then down.

    Raises
    ------
    EngravingError: the die cannot be read so; the message names an outcome and what is above it.
    """
    below = _on_facets("down", hull, labels, facets)
    if read == "down":
        return (below,)
    level = opposite_facets(hull, facets)
    if read == "both":
        _require_free_tops(hull, facets, labels, level)
        return (_on_facets("both", hull, labels, facets, level),)
    above: tuple[Reading, ...] = ()
    corners = np.full(len(facets), -1)
    if _are_own(level):
        above = (_on_facets("up", hull, labels, level),)
    elif read == "up" or len(facets) == len(hull.normals) == ALL_AROUND:
        corners = np.array([_top_corner(hull, facet) for facet in facets.tolist()])
        if _are_own(corners):
            above = (_around_corners(hull, labels, corners, facets),)
    if read == "auto":
        return (*above, below)
    if not above:
        raise _unreadable(hull, facets, labels, level, corners)
    return above


def _are_own(on_top: Integers) -> bool:
    """Whether each outcome has something on top, no two the same."""
    return bool((on_top >= 0).all()) and len(np.unique(on_top)) == len(on_top)


def _on_facets(way: str, hull: ConvexHull, labels: Sequence[str], *sides: Integers) -> Reading:
    """Labels on whole facets, one of each of some sides (k,) for each outcome."""
    places = tuple(
        LabelPlace(text, outcome, facet, hull.polygon(facet), hull.normals[facet])
        for outcome, (text, *mine) in enumerate(
            zip(labels, *(side.tolist() for side in sides), strict=True)
        )
        for facet in mine
    )
    return Reading(way, SENTENCES[way], places)


def _around_corners(
    hull: ConvexHull, labels: Sequence[str], corners: Integers, facets: Integers
) -> Reading:
    """Labels on all facets around the corner (k,) that is on top while the die rests on a facet
    (k,)."""
    places = []
    for outcome, (corner, below) in enumerate(zip(corners.tolist(), facets.tolist(), strict=True)):
        for half_edge in _leaving(hull, corner):
            facet = int(hull.facet[half_edge])
            if facet != below:
                region = _corner_region(hull, half_edge)
                normal = hull.normals[facet]
                places.append(LabelPlace(labels[outcome], outcome, facet, region, normal))
    return Reading("corner", SENTENCES["corner"], tuple(places))


def _leaving(hull: ConvexHull, corner: int) -> list[int]:
    start, half_edges = hull.outgoing
    leaving: list[int] = half_edges[start[corner] : start[corner + 1]].tolist()
    return leaving


def _corner_region(hull: ConvexHull, half_edge: int) -> Floats:
    """Part (m, 3) of a facet at the corner that a half-edge of it leaves: as wide as half of the
    way to the nearest other corner, without so much of the tip that its base is its longest edge.
    Those of a facet's corners do not meet."""
    corner = hull.vertices[hull.tail[half_edge]]
    others = hull.polygon(int(hull.facet[half_edge])) - corner
    reach = 0.5 * float(np.sort(norms(others))[1])
    sides = np.stack(
        [
            hull.vertices[hull.head[half_edge]] - corner,
            hull.vertices[hull.tail[hull.previous[half_edge]]] - corner,
        ]
    )
    right, left = reach * sides / norms(sides)[:, None]
    # A side less the tip over the base, whose length over that of a whole side is twice this sine.
    sine = float(norms(right - left)) / (2.0 * reach)
    tip = 1.0 - 2.0 * TAPER * sine
    if tip <= 0.0:
        return np.stack([corner, corner + right, corner + left])
    return corner + np.stack([tip * right, right, left, tip * left])


def _top_corner(hull: ConvexHull, facet: int) -> int:
    """The corner on top while a die rests on a facet, or -1 where there is none that is seen from
    above on all facets around it."""
    up = -hull.normals[facet]
    heights = hull.vertices @ up
    *_, second, top = np.argsort(heights, kind="stable").tolist()
    if heights[top] - heights[second] < PEAK * np.ptp(heights):
        return -1
    around = hull.facet[_leaving(hull, top)]
    return top if (hull.normals[around] @ up >= RISE).all() else -1


def _require_free_tops(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], level: Integers
) -> None:
    """Raise EngravingError where an outcome has no level facet on top, or one that bears another
    outcome's label."""
    for outcome, facet in enumerate(level.tolist()):
        others = np.flatnonzero((facets == facet) | (level == facet))
        others = others[others != outcome]
        if facet < 0:
            got = _what_is_above(hull, int(facets[outcome]))
        elif len(others):
            got = f"one that bears the label of {labels[int(others[0])]!r} too"
        else:
            continue
        raise EngravingError(
            f"read: expected a level facet of its own on top of each outcome for both, got {got} "
            f"on top of {labels[outcome]!r}; leave read out, or write read: down"
        )


def _unreadable(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], level: Integers, corners: Integers
) -> EngravingError:
    """What keeps a die from being read from above."""
    on_top = level if (level >= 0).sum() >= (corners >= 0).sum() else corners
    what = "level facet" if on_top is level else "corner"
    lacking = np.flatnonzero(on_top < 0)
    if len(lacking):
        outcome = int(lacking[0])
        got = _what_is_above(hull, int(facets[outcome]))
    else:
        _, first, counts = np.unique(on_top, return_index=True, return_counts=True)
        outcome = int(first[counts > 1][0])
        other = int(np.flatnonzero(on_top == on_top[outcome])[1])
        got = f"the {what} that is on top of {labels[other]!r} too"
    return EngravingError(
        f"read: expected a {what} of its own on top of each outcome for up, got {got} on top of "
        f"{labels[outcome]!r}; write read: down"
    )


def _what_is_above(hull: ConvexHull, facet: int) -> str:
    """What is on top while a die rests on a facet, in words."""
    up = -hull.normals[facet]
    heights = hull.vertices @ up
    near = int((heights > heights.max() - PEAK * np.ptp(heights)).sum())
    if near == 1:
        around = hull.facet[_leaving(hull, int(heights.argmax()))]
        if (hull.normals[around] @ up >= RISE).all():
            return "a corner"
        return "a corner with facets that are not seen from above"
    lean = math.degrees(float(angle_between(up, hull.normals).min()))
    what = "an edge" if near == 2 else "no level facet"
    return f"{what}, the nearest facet leaning by {lean:.0f} degrees,"


def core_of(poses: RestPoses, edges: EdgeOptions | None) -> ConvexHull:
    """The shape inside the rounded edges of a convex die, its facets numbered as those of the die.

    Raises EngravingError where the radius is larger than the circle of a facet to rest on.
    """
    hull = poses.hull
    if edges is None:
        return hull
    core = convex_hull(core_scale(edges, hull.diameter) * hull.vertices)
    for facet in poses.facets.tolist():
        room = facet_inradius(core, facet)
        if edges.radius_mm > room:
            raise EngravingError(
                f"edges.radius_mm: expected at most the radius of the circle that is left flat on "
                f"facet {facet}, {room:.3g} mm, got {edges.radius_mm:g}; lower it, or take a "
                "larger size_mm"
            )
    return core


def place_on_facets(
    poses: RestPoses,
    main: Integers,
    hull: ConvexHull,
    labels: Sequence[str],
    options: EngravingOptions,
) -> tuple[Reading, list[Placement]]:
    """How a die is read, and where its labels lie on the facets of its hull, or of its core
    (`core_of`), in the order of the places of that reading.

    poses: rests of the die in mm; main: (k,) the rest of each outcome, or -1.

    Raises EngravingError where an outcome has no facet to rest on, the die cannot be read as the
    options say, or a label does not fit.
    """
    from dicedesign.fabricate.engraving import require_fields
    from dicedesign.fabricate.label_layout import edge_margins, place_labels
    from dicedesign.fabricate.label_reading import die_readings

    require_rests(labels, main, "a facet")
    *better, last = die_readings(hull, poses.facets[main], labels, options.read)

    def placed(reading: Reading) -> list[Placement]:
        places, whole = reading.places, reading.way != "corner"
        return place_labels(
            [place.text for place in places],
            [place.region for place in places],
            [place.normal for place in places],
            [place.facet for place in places],
            # Around a corner labels stand upright toward it.
            options if whole else replace(options, upright="edge"),
            poses.hull.diameter,
            [edge_margins(hull, place.facet, options) for place in places] if whole else None,
        )

    for reading in better:
        with suppress(EngravingError):
            placements = placed(reading)
            require_fields(hull, placements, options)
            return reading, placements
    return last, placed(last)


def require_rests(labels: Sequence[str], main: Integers, what: str) -> None:
    """Raise EngravingError where an outcome, by the number (k,) of its own rest or -1, has none.

    what: it is to have, in words.
    """
    if (main < 0).any():
        raise EngravingError(
            f"label {labels[int(main.argmin())]!r}: expected {what} to rest on for each label, got "
            "none for this one; finish the design first"
        )
