"""Places of labels on parts of facets: margins, middles, sizes and uprights.

Lengths are in millimeters.
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
from dicedesign.fabricate.label_reading import LabelPlace
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import centroid, inscribed_box
from dicedesign.geometry.sphere import norms, rigid_motion, rotation_between
from dicedesign.runtime.arrays import Floats

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
"""Relative tolerance of heights."""

TIE_DECIMALS = 4

TIE = 10.0**-TIE_DECIMALS
"""Relative tolerance of lengths, and tolerance of unit directions, on regions with symmetry."""

USUAL_LABEL = (1.7, 1.0)
"""Width and height of a label of two digits, for which there is most room along a mirror line."""

HYPHEN_GAIN = 1.1
"""Least factor by which each hyphen must enlarge a label."""

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
    fits, labels = [], {place.text for place in places}
    for place, ups, margin in zip(places, upright_choices(places, options), gaps, strict=True):
        arts = label_arts(place.text, options, labels)
        best, *others = (_fit(place, art, up, options, margin) for up in ups for art in arts)
        for fit in others:
            if _room(fit, options) > (1.0 + LONGER) * _room(best, options):
                best = fit
        fits.append(best)
    placements = [placement for placement, _ in fits]
    require_room(placements, [needed for _, needed in fits], size_mm, options)
    return placements


def _room(fit: tuple[Placement, float], options: EngravingOptions) -> float:
    """Height over the least one, or else the inverse of the factor for it; less for hyphens."""
    placement, needed = fit
    room = 1.0 / needed if needed > 0.0 else placement.height / options.min_height_mm
    return room / HYPHEN_GAIN**placement.art.hyphens


def upright_choices(places: Sequence[LabelPlace], options: EngravingOptions) -> list[Floats]:
    """Unit directions (n, 3) in which the labels of k places may be upright, the best first.

    The first is along a mirror line of the region, the one with most room, toward its farther end;
    or away from the longest edge of a region without one. So it moves with the region under any
    rotation or reflection. Of directions that a rotation of the region maps onto each other, an
    axis of the body decides, about which the chosen ones are images of each other too.
    """
    normals = np.array([place.normal / np.linalg.norm(place.normal) for place in places])
    choices = [
        _uprights(place, normal, options) for place, normal in zip(places, normals, strict=True)
    ]
    middles = np.array([place.region.mean(axis=0) for place in places])
    toward = np.concatenate([place.region for place in places]) - middles.mean(axis=0)
    axes = np.vstack([np.linalg.eigh(normals.T @ normals)[1].T, toward])
    axes /= norms(axes)[:, None]
    # The axis about which the facets are most alike comes first.
    heights = np.sort(np.abs(axes @ normals.T), axis=1)
    order = np.argsort((np.diff(heights) > TIE).sum(axis=1), kind="stable")
    for k, (ups, others) in enumerate(choices):
        for axis in axes[order] if len(ups) > 1 else ():
            ups = _nearest_axis(ups, normals[k], axis)
            if len(ups) == 1:
                break
        choices[k] = ups[:1], others
    return [np.vstack(each) for each in choices]


def _uprights(
    place: LabelPlace, outward: Floats, options: EngravingOptions
) -> tuple[Floats, Floats]:
    """Directions (n, 3) that are equally good for a label upright on a region, and others (m, 3)
    that may leave more room."""
    others = np.empty((0, 3))
    given = place.up
    if given is None and not isinstance(options.upright, str):
        given = np.array(options.upright)
    if given is not None:
        along = given - (given @ outward) * outward
        length = float(np.linalg.norm(along))
        if length > STEEPEST * np.linalg.norm(given):
            return along[None] / length, others
    edges = np.roll(place.region, -1, axis=0) - place.region
    right = edges[norms(edges).argmax()]
    right = right - (right @ outward) * outward
    right /= np.linalg.norm(right)
    plane = np.stack([right, np.cross(outward, right)])
    corners = place.region @ plane.T
    corners = corners - centroid(corners)
    size = float(norms(corners).max())
    edges = (np.roll(corners, -1, axis=0) - corners) / size
    lengths = norms(edges)
    edges, lengths = edges[lengths > TIE], lengths[lengths > TIE]
    inward = np.column_stack([-edges[:, 1], edges[:, 0]]) / lengths[:, None]
    toward = corners[norms(corners) > TIE * size]
    toward = toward / norms(toward)[:, None]
    mirror_lines = [
        line
        for line in (*inward, *-inward, *toward, *-toward)
        if _is_close(2.0 * np.outer(corners @ line, line) - corners, corners, TIE * size)
    ]
    ups = np.array(mirror_lines or inward[lengths >= lengths.max() - TIE])
    ups = ups[np.unique(ups.round(TIE_DECIMALS), axis=0, return_index=True)[1]]
    room = [
        inscribed_box(corners @ np.array([[up[1], up[0]], [-up[0], up[1]]]), USUAL_LABEL)[1] / size
        for up in ups
    ]
    ups = _keep_best(ups, np.array(room), (corners @ ups.T).max(axis=0) / size)
    if options.upright == "largest":
        others = inward[np.argsort(-lengths, kind="stable")] @ plane
    return ups @ plane, others


def _is_close(points: Floats, others: Floats, distance: float) -> bool:
    """Whether each of some points (n, 2) is within a distance of one of the others (m, 2)."""
    return bool((norms(points[:, None] - others).min(axis=1) <= distance).all())


def _nearest_axis(ups: Floats, normal: Floats, axis: Floats) -> Floats:
    """Those of some directions (n, 3) that an axis of the body prefers: along it, toward its end on
    the side of the facet; all but the last two criteria hold for the opposite axis too."""
    along, turn = ups @ axis, ups @ np.cross(axis, normal)
    return _keep_best(ups, np.abs(along), along * (normal @ axis), along * turn, turn, along)


def _keep_best(rows: Floats, *measures: Floats) -> Floats:
    """Rows (n, m) with the largest of the first measures (n,), of these those with the largest of
    the second, and so on, to within `TIE`."""
    kept = np.arange(len(rows))
    for measure in measures:
        kept = kept[measure[kept] >= measure[kept].max() - TIE]
    return rows[kept]


def _fit(
    place: LabelPlace,
    art: LabelArt,
    up: Floats,
    options: EngravingOptions,
    margins: float | Floats,
) -> tuple[Placement, float]:
    """Largest placement of a label that is upright in a direction (3,), and the least factor by
    which the facet must grow for digits of `min_height_mm`, or 0."""
    outward = place.normal / np.linalg.norm(place.normal)
    right = np.cross(up, outward)
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
