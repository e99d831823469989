"""How a die is read, which part of a facet each label gets for that, and its place there: middle,
size and upright.

A label lies on the facet that the die rests on, on the one that is level on top then, or around the
corner that is on top, upright toward it, as on a tetrahedron. Lengths are in millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from manifold3d import CrossSection

from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import LabelArt, grown, holes_and_parts, label_arts
from dicedesign.fabricate.numbering import opposite_facets
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import inscribed_box
from dicedesign.geometry.sphere import angle_between, norms, rotation_between
from dicedesign.runtime.arrays import Floats, Integers

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
    """Way to read a die: from which side, and where the labels are.

    Attributes
    ----------
    way: "down", "up" or "both" with labels on facets below, on top or on both, "corner" around the
        corner on top, or "marks" in the upper side of a die that keeps the shape of a surface.
    places: of the labels, in the order of the outcomes; none with "marks".
    """

    way: str
    places: tuple[LabelPlace, ...] = ()

    @property
    def sentence(self) -> str:
        """Instruction for the reader of the die."""
        return SENTENCES[self.way]


SENTENCES: Final = {
    "down": "Lift the die: the label on the facet that lay on the table counts.",
    "up": "Read the label on top.",
    "both": "Read the label on top; the one that lies on the table is the same.",
    "corner": "Read the label that stands upright around the top corner.",
    "marks": "Read the label on the side that is up.",
}


def die_readings(
    hull: ConvexHull, facets: Integers, labels: Sequence[str], read: str
) -> tuple[Reading, ...]:
    """Ways to read a die with their label places, the best first; the next is tried if the labels
    do not fit.

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
    level, above = opposite_facets(hull, facets), None
    flaw = _flaw(hull, facets, labels, level, "level facet", read)
    if not flaw:
        above = _on_facets("up", hull, labels, level)
        if read == "both":
            above = _on_facets("both", hull, labels, facets, level)
    elif read == "up" or (read == "auto" and len(facets) == len(hull.normals) == ALL_AROUND):
        corners = np.array([_top_corner(hull, facet) for facet in facets.tolist()])
        other = _flaw(hull, facets, labels, corners, "corner", read)
        if not other:
            above = _around_corners(hull, labels, corners, facets)
        elif (corners >= 0).sum() > (level >= 0).sum():
            flaw = other
    if above is None and read != "auto":
        raise EngravingError(flaw)
    better = () if above is None else (above,)
    return (*better, below) if read == "auto" else better


def _flaw(
    hull: ConvexHull,
    facets: Integers,
    labels: Sequence[str],
    on_top: Integers,
    what: str,
    read: str,
) -> str:
    """Which outcome has nothing (k,) on top of it, or what another has too, in a sentence; "" where
    each has its own."""
    for outcome, top in enumerate(on_top.tolist()):
        is_same = on_top == top
        if read == "both":
            is_same |= facets == top
        is_same[outcome] = False
        if top < 0:
            got = _what_is_above(hull, int(facets[outcome]))
        elif is_same.any():
            got = f"one that {labels[int(is_same.argmax())]!r} has too"
        else:
            continue
        return (
            f"read: expected a {what} of its own on top of each outcome for {read}, got {got} on "
            f"top of {labels[outcome]!r}; write read: down, or leave read out"
        )
    return ""


def _on_facets(way: str, hull: ConvexHull, labels: Sequence[str], *sides: Integers) -> Reading:
    """Labels on whole facets, one of each of some sides (k,) for each outcome."""
    places = tuple(
        LabelPlace(text, outcome, facet, hull.polygon(facet), hull.normals[facet])
        for outcome, (text, mine) in enumerate(zip(labels, np.stack(sides, axis=1), strict=True))
        for facet in mine.tolist()
    )
    return Reading(way, places)


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
    return Reading("corner", tuple(places))


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
    ends = [hull.head[half_edge], hull.tail[hull.previous[half_edge]]]
    sides = hull.vertices[ends] - corner
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


def _what_is_above(hull: ConvexHull, facet: int) -> str:
    """Top of a die that rests on a facet, in words."""
    up = -hull.normals[facet]
    heights = hull.vertices @ up
    near = int((heights > heights.max() - PEAK * np.ptp(heights)).sum())
    if near == 1:
        hidden = " with facets that are not seen from above"
        return "a corner" if _top_corner(hull, facet) >= 0 else f"a corner{hidden}"
    lean = math.degrees(float(angle_between(up, hull.normals).min()))
    what = "an edge" if near == 2 else "no level facet"
    return f"{what}, the nearest facet leaning by {lean:.0f} degrees,"


WALL: Final = 0.5
"""Distance along the facet, over the least one, that a pocket keeps from the plane which halves the
angle at an edge; the wall between it and a pocket beyond is twice as thick."""

LEAST_SINE: Final = 1e-3
"""Sine of the angle between two planes below which they count as parallel."""

SHARPEST: Final = 1e-12
"""One plus the cosine of the angle between the normals of two facets is taken for at least that."""


def edge_margins(hull: ConvexHull, facet: int, options: EngravingOptions) -> Floats:
    """Distances (m,) in mm that labels keep from the edges of a facet, in the order of its corners:
    the margin, and more along a sharp edge; from the border, where they are raised.

    hull: the die in mm; options: style, depth, margin and border.
    """
    edges = slice(int(hull.facet_start[facet]), int(hull.facet_start[facet + 1]))
    cosines = hull.normals[hull.facet[hull.twin[edges]]] @ hull.normals[facet]
    if options.style == "raised":
        return _walls(cosines, options.depth_mm, options.border_mm) + options.margin_mm
    return _walls(cosines, options.depth_mm, options.margin_mm)


def border_lines(
    hull: ConvexHull, facet: int, frame: Floats, options: EngravingOptions
) -> tuple[Floats, Floats]:
    """Inner lines of the border of a sunk field, one for each plane that meets that of the facet.

    frame: (4, 4) with the facet in its plane of x and y. Returns distances (n,) in mm from the
    origin and unit directions (n, 2): the field lies beyond.
    """
    flat = -hull.normals @ frame[:3, :2]
    sines = norms(flat)
    meets = sines > LEAST_SINE
    meets[facet] = False
    cosines, sines = (hull.normals @ hull.normals[facet])[meets], sines[meets]
    widths = _walls(cosines, options.depth_mm, options.border_mm)
    distances = widths - hull.heights(frame[:3, 3])[meets] / sines
    return distances, flat[meets] / sines[:, None]


def _walls(cosines: Floats, depth: float, least: float) -> Floats:
    """Distances (m,) of at least the least one from where two planes meet, at which pockets of a
    depth leave a wall; cosines: (m,) of the angles between their normals.

    A pocket of depth d reaches the plane that halves the angle between two facets where it comes as
    near to their edge as d tan(a / 2), for an angle a between their normals.
    """
    halves = np.sqrt((1.0 - cosines).clip(0.0) / (1.0 + cosines).clip(SHARPEST))
    sharp: Floats = depth * halves + WALL * least
    return np.maximum(least, sharp)


CENTERING: Final = 0.12
"""Part of the largest height given up to bring a label nearer to the middle of its facet."""

STEEPEST: Final = 1e-3
"""Sine of the angle between a facet's normal and the direction toward which labels are upright
below which that direction says nothing on this facet."""

LONGER: Final = 1e-6
"""Relative difference of two heights or lengths of edges that counts."""

MOST_ROUNDS: Final = 20
"""Of fitting a label and the growth of its strokes to each other, which takes three."""


@dataclass(frozen=True, eq=False)
class Placement:
    """A label in its place: the point (x, y) of its outlines, in digit heights, lies at
    `frame @ (height * x, height * y, 0, 1)` on the body.

    Attributes
    ----------
    text: the label.
    frame: (4, 4) rigid motion from local x (right), y (up), z (out of the facet, or from the table
        upward) to the body, in mm.
    height: digit height in mm.
    art: what it looks like, in digit heights.
    facet: index of the facet; None on the upper side of a die that keeps the shape of a surface.
    growth: distance in mm by which its outlines move outward, for strokes wide enough.
    """

    text: str
    frame: Floats
    height: float
    art: LabelArt
    facet: int | None = None
    growth: float = 0.0

    @property
    def where(self) -> str:
        """The label and its facet, as messages call them."""
        return f"{self.text!r}" if self.facet is None else f"{self.text!r} on facet {self.facet}"

    def section(self) -> CrossSection:
        """The label in its own plane, in mm about the origin of the frame.

        Raises EngravingError where wider strokes would close a hole or join parts.
        """
        plain = self.art.section.scale((self.height, self.height))
        wider = grown(plain, self.growth)
        before, after = holes_and_parts(plain), holes_and_parts(wider)
        if before != after:
            raise EngravingError(
                f"label {self.where}: expected {before[0]} holes and {before[1]} parts to stay "
                f"apart with strokes wider by {2.0 * self.growth:.2f} mm at a digit height of "
                f"{self.height:.2f} mm, got {after[0]} and {after[1]}; reduce stroke_mm, increase "
                "size_mm, or take another font or a shorter label"
            )
        return wider

    def shift(self, shift: Floats) -> Placement:
        """Placement moved by a shift (3,) in mm."""
        frame = self.frame.copy()
        frame[:3, 3] += shift
        return replace(self, frame=frame)

    def stretch(self, matrix: Floats) -> Placement:
        """Placement on a body that was stretched slightly by a symmetric matrix (3, 3)."""
        frame = self.frame.copy()
        normal = np.asarray(np.linalg.solve(matrix, frame[:3, 2]), dtype=np.float64)
        frame[:3, :3] = rotation_between(self.frame[:3, 2], normal) @ frame[:3, :3]
        frame[:3, 3] = matrix @ frame[:3, 3]
        return replace(self, frame=frame)


def place_labels(
    places: Sequence[LabelPlace],
    options: EngravingOptions,
    size_mm: float,
    margins: Sequence[Floats] | None = None,
) -> list[Placement]:
    """Place labels on their facets, each as large as fits.

    A label's bounding box, the mark of an ambiguous one included, is nearly the largest upright
    rectangle of its proportions that keeps the margins from the edges of its region, and nearly in
    the middle; of several lines and uprights that it may have, the largest.

    Parameters
    ----------
    places: of k labels.
    options: looks, sizes, upright and margin.
    size_mm: present largest distance between two vertices of the die, above 0.
    margins: k arrays (m,) of distances in mm from the edges of a region, each from a corner to the
        next, such as `edge_margins` gives; by default `options.margin_mm` from all.

    Returns
    -------
    list of k placements.

    Raises
    ------
    InputError: a font or an icon cannot be read.
    LabelRoomError: a label is too small to read. Of several the message is about that which needs
        the largest die; the size it gives does for all.
    EngravingError: a label cannot be drawn.
    """
    gaps: Sequence[float | Floats] = margins or [options.margin_mm] * len(places)
    placements, needed = [], []
    for place, margin in zip(places, gaps, strict=True):
        arts = label_arts(place.text, options)
        best = None
        outward = place.normal / np.linalg.norm(place.normal)
        for right in _rights(place.region, outward, options):
            for art in arts:
                fit = _fit(place, art, right, outward, options, margin)
                if best is None or fit[0].height > (1.0 + LONGER) * best[0].height:
                    best = fit
        assert best is not None
        placements.append(best[0])
        needed.append(best[1])
    require_room(placements, needed, size_mm, options)
    return placements


def _rights(region: Floats, outward: Floats, options: EngravingOptions) -> list[Floats]:
    """Directions (3,) that may be right on a label, the preferred ones first."""
    if not isinstance(options.upright, str):
        up = np.array(options.upright) / np.linalg.norm(options.upright)
        right = np.cross(up, outward)
        length = float(np.linalg.norm(right))
        if length > STEEPEST:
            return [right / length]
    edges = np.roll(region, -1, axis=0) - region
    edges -= np.outer(edges @ outward, outward)
    lengths = np.linalg.norm(edges, axis=1)
    longest = int(lengths.argmax())
    if options.upright != "largest":
        return [edges[longest] / lengths[longest]]
    order = sorted(range(len(edges)), key=lambda k: (k != longest, -lengths[k]))
    return [edges[k] / lengths[k] for k in order if lengths[k] > LONGER * lengths[longest]]


def _fit(
    place: LabelPlace,
    art: LabelArt,
    right: Floats,
    outward: Floats,
    options: EngravingOptions,
    margins: float | Floats,
) -> tuple[Placement, float]:
    """A label as large as it fits with directions (3,) to its right and out of the facet, and by
    which factor the facet must grow, at least, for digits of `min_height_mm`, or 0."""
    up = np.cross(outward, right)
    origin = place.region.mean(axis=0)
    flat = (place.region - origin) @ np.column_stack([right, up])
    least, growth = options.min_height_mm, 0.0
    for _ in range(MOST_ROUNDS):
        center, height = inscribed_box(
            flat,
            art.size,
            margin=margins + growth,
            slack=CENTERING,
            least=least,
            most=options.max_height_mm,
        )
        wanted = art.growth(height, options.stroke_mm) if height > 0.0 else growth
        if wanted <= growth:
            break
        # Smaller digits need to grow more.
        growth = min(wanted + LONGER * options.stroke_mm, 0.5 * options.stroke_mm)
    needed = 0.0
    if height < least:
        # A facet as many times as large has room for digits of the least height and the margin.
        width, tall = art.size
        rim = margins + 0.5 * options.stroke_mm
        needed = 1.0 / inscribed_box(flat, (width * least, tall * least), rim=rim)[1]
    left, bottom, far_right, top = art.box
    x, y = center - 0.5 * height * np.array([left + far_right, bottom + top])
    frame = np.eye(4)
    frame[:3] = np.column_stack([right, up, outward, origin + x * right + y * up])
    return Placement(place.text, frame, height, art, place.facet, growth), needed


def require_room(
    placements: Sequence[Placement],
    needed: Sequence[float],
    size_mm: float,
    options: EngravingOptions,
) -> None:
    """Raise LabelRoomError if a label is too small to read: about that which needs the largest die,
    with a size of the die at which all are large enough.

    needed: k factors by which the die must grow for those that are too small; size_mm: present
    largest distance between two vertices of the die.
    """
    small = [k for k, each in enumerate(placements) if each.height < options.min_height_mm]
    if not small:
        return
    worst = max(small, key=lambda k: needed[k])
    label = placements[worst]
    width, tall = (label.height * side for side in label.art.size)
    room = "the upper side" if label.facet is None else f"facet {label.facet}"
    size = (math.floor(10 * size_mm * needed[worst]) + 1) / 10
    raise LabelRoomError(
        f"label {label.text!r}: expected room on {room} for digits of at least min_height_mm = "
        f"{options.min_height_mm:g}, got {label.height:.2f} mm in a rectangle of {width:.2f} by "
        f"{tall:.2f} mm ({len(small)} of {len(placements)} labels are too small at size_mm = "
        f"{size_mm:g}); use size_mm = {size:.1f} or more, or a shorter label, a smaller margin_mm, "
        "depth_mm or min_height_mm",
        size,
    )
