"""Ways to read a die, and the places of its labels: parts of facets, middles, sizes and uprights.

Labels are on the facet that the die rests on, on the level facet on top, or around the corner on
top, upright toward it, as on a tetrahedron. Lengths are in millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from manifold3d import CrossSection, Manifold

from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import LabelArt, grown, holes_and_parts, label_arts
from dicedesign.fabricate.numbering import opposite_facets
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import inscribed_box
from dicedesign.geometry.sphere import angle_between, norms, rigid_motion, rotation_between
from dicedesign.results.parts import READINGS
from dicedesign.runtime.arrays import Floats, Integers

PEAK = 0.05
"""Least height of a top corner above all others, over the die's height."""

RISE = 0.1
"""Least cosine between a facet's normal and up at which the facet is readable from above."""

TAPER = 0.85
"""Longest side of a corner region of a facet, over its base, which is below the label."""

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
    way: "down", "up" or "both" for labels on facets below, on top or both, "corner" for those
        around the corner on top, or "marks" for the upper side of a concave die.
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
    read: "down"; "up", on level facets on top, or else around corners on top; "both", below and on
        level facets on top; or "auto": up if all facets on top are level or the die is a
        tetrahedron, and then down.

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
    elif read == "up" or (read == "auto" and len(facets) == len(hull.normals) == ALL_AROUND):
        corners = np.array([_top_corner(hull, facet) for facet in facets.tolist()])
        without = ["none seen from above"] * len(facets)
        other = _flaw(facets, labels, corners, "corner", read, without)
        if not other:
            above = _around_corners(hull, labels, corners, facets)
        elif (corners >= 0).sum() > (level >= 0).sum():
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


WALL = 0.5
"""Distance along the facet between a pocket and the plane that bisects the angle at an edge, over
the least margin; the wall to a pocket beyond the edge is twice as thick."""

SHARPEST = 1e-12
"""Lower bound of one plus the cosine between the normals of two facets."""


def edge_margins(hull: ConvexHull, facet: int, options: EngravingOptions) -> Floats:
    """Distances (m,) in mm of labels from the edges of a facet, in the order of its corners: the
    margin, larger along a sharp edge; the border is added for raised labels.

    hull: the die in mm; options: style, depth, margin and border.
    """
    edges = slice(*hull.facet_start[facet : facet + 2].tolist())
    cosines = hull.normals[hull.facet[hull.twin[edges]]] @ hull.normals[facet]
    if options.style == "raised":
        return wall_distances(cosines, options.depth_mm, options.border_mm) + options.margin_mm
    return wall_distances(cosines, options.depth_mm, options.margin_mm)


def wall_distances(cosines: Floats, depth: float, least: float) -> Floats:
    """Distances (m,) from the edges between planes, at least the least one, at which pockets of a
    depth leave a wall; cosines: (m,) between the normals of the planes.

    A pocket of depth d reaches the bisecting plane of two facets at a distance d tan(a / 2) from
    their edge, for an angle a between their normals.
    """
    tangents = np.sqrt((1.0 - cosines).clip(0.0) / (1.0 + cosines).clip(SHARPEST))
    return np.maximum(least, depth * tangents + WALL * least)


CENTERING = 0.12
"""Share of the largest height given up to center a label on its facet."""

STEEPEST = 1e-3
"""Least sine between a facet's normal and the upright direction at which the direction applies to
the facet."""

LONGER = 1e-6
"""Relative tolerance of heights and lengths of edges."""

MOST_ROUNDS = 20
"""Largest number of rounds that fit the height of a label and the growth of its strokes; three are
usual."""


@dataclass(frozen=True, eq=False)
class Placement:
    """Placed label: the point (x, y) of its outlines, in digit heights, is at
    `frame @ (height * x, height * y, 0, 1)` on the body.

    Attributes
    ----------
    text: the label.
    frame: (4, 4) rigid motion from local x (right), y (up), z (out of the facet, or from the table
        upward) to the body, in mm.
    height: digit height in mm.
    art: outlines in digit heights.
    facet: index of the facet; None on the upper side of a concave die.
    growth: distance in mm by which outlines move outward to widen strokes.
    depth_share: depth of its pocket over that of the options.
    """

    text: str
    frame: Floats
    height: float
    art: LabelArt
    facet: int | None = None
    growth: float = 0.0
    depth_share: float = 1.0

    @property
    def plane(self) -> Floats:
        """(3, 2) directions to the right and up on the label."""
        return self.frame[:3, :2]

    @property
    def normal(self) -> Floats:
        """(3,) direction out of the facet."""
        return self.frame[:3, 2]

    @property
    def origin(self) -> Floats:
        """(3,) point on the body."""
        return self.frame[:3, 3]

    @property
    def where(self) -> str:
        """Label and facet in messages."""
        return repr(self.text) if self.facet is None else f"{self.text!r} on facet {self.facet}"

    def section(self) -> CrossSection:
        """Plane section of the label, in mm about the origin of the frame.

        Raises EngravingError if wider strokes would close a hole or join parts.
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

    def sink(self, section: CrossSection, depth: float, height: float) -> Manifold:
        """Prism on a section in the plane of the label, from a depth below it, with a height."""
        return section.extrude(height).translate((0.0, 0.0, -depth)).transform(self.frame[:3])

    def turn(self, rotation: Floats) -> Placement:
        """Placement turned about its origin by a rotation (3, 3)."""
        return replace(self, frame=rigid_motion(rotation @ self.frame[:3, :3], self.origin))

    def move_to(self, origin: Floats) -> Placement:
        """Placement with another origin (3,)."""
        return replace(self, frame=rigid_motion(self.frame[:3, :3], origin))

    def shift(self, shift: Floats) -> Placement:
        """Placement moved by a shift (3,) in mm."""
        return self.move_to(self.origin + shift)

    def stretch(self, matrix: Floats) -> Placement:
        """Placement on a body that was stretched slightly by a symmetric matrix (3, 3)."""
        normal = np.asarray(np.linalg.solve(matrix, self.normal), dtype=np.float64)
        return self.turn(rotation_between(self.normal, normal)).move_to(matrix @ self.origin)


def place_labels(
    places: Sequence[LabelPlace],
    options: EngravingOptions,
    size_mm: float,
    margins: Sequence[Floats] | None = None,
) -> list[Placement]:
    """Place labels on their facets, each as large as fits.

    The bounding box of a label, with the mark of an ambiguous one, is nearly the largest upright
    rectangle of its proportions within the margins of its region, and nearly centered. Of its
    possible line breaks and uprights it has the largest.

    Parameters
    ----------
    places: of k labels.
    options: looks, sizes, upright and margin.
    size_mm: present largest distance between two vertices of the die, above 0.
    margins: k arrays (m,) of distances in mm from the edges of a region, each from a corner to the
        next, such as from `edge_margins`; None for `options.margin_mm` everywhere.

    Raises
    ------
    InputError: a font or an icon cannot be read.
    LabelRoomError: a label is too small to read. The message is about the one that needs the
        largest die; its size suffices for all.
    EngravingError: a label cannot be drawn.
    """
    gaps: Sequence[float | Floats] = margins or [options.margin_mm] * len(places)
    fits = []
    for place, margin in zip(places, gaps, strict=True):
        outward = place.normal / np.linalg.norm(place.normal)
        rights, arts = _rights(place.region, outward, options), label_arts(place.text, options)
        first, *others = (
            _fit(place, art, right, outward, options, margin) for right in rights for art in arts
        )
        for fit in others:
            if fit[0].height > (1.0 + LONGER) * first[0].height:
                first = fit
        fits.append(first)
    placements = [placement for placement, _ in fits]
    require_room(placements, [needed for _, needed in fits], size_mm, options)
    return placements


def _rights(region: Floats, outward: Floats, options: EngravingOptions) -> list[Floats]:
    """Candidates (3,) for the direction to the right on a label, in order of preference."""
    if not isinstance(options.upright, str):
        up = np.array(options.upright) / np.linalg.norm(options.upright)
        right = np.cross(up, outward)
        length = float(np.linalg.norm(right))
        if length > STEEPEST:
            return [right / length]
    edges = np.roll(region, -1, axis=0) - region
    edges -= np.outer(edges @ outward, outward)
    lengths = np.linalg.norm(edges, axis=1)
    order = np.argsort(-lengths, kind="stable")
    rights = [edges[k] / lengths[k] for k in order if lengths[k] > LONGER * lengths.max()]
    return rights if options.upright == "largest" else rights[:1]


def _fit(
    place: LabelPlace,
    art: LabelArt,
    right: Floats,
    outward: Floats,
    options: EngravingOptions,
    margins: float | Floats,
) -> tuple[Placement, float]:
    """Largest placement of a label with directions (3,) to its right and out of the facet, and the
    least factor by which the facet must grow for digits of `min_height_mm`, or 0."""
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
        # Smaller digits need more growth.
        growth = min(wanted + LONGER * options.stroke_mm, 0.5 * options.stroke_mm)
    needed = 0.0
    if height < least:
        # A facet larger by this factor has room for digits of the least height and the margin.
        width, tall = art.size
        rim = margins + 0.5 * options.stroke_mm
        needed = 1.0 / inscribed_box(flat, (width * least, tall * least), rim=rim)[1]
    left, bottom, far_right, top = art.box
    x, y = center - 0.5 * height * np.array([left + far_right, bottom + top])
    axes = np.column_stack([right, up, outward])
    frame = rigid_motion(axes, origin + x * right + y * up)
    return Placement(place.text, frame, height, art, place.facet, growth), needed


def require_room(
    placements: Sequence[Placement],
    needed: Sequence[float],
    size_mm: float,
    options: EngravingOptions,
) -> None:
    """Raise LabelRoomError if a label is too small to read, about the one that needs the largest
    die, with a size of the die that suffices for all.

    needed: k factors by which the die must grow for labels that are too small; size_mm: present
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
