"""Places of labels on facets: middle, size and upright.

Lengths are in millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from manifold3d import CrossSection

from dicedesign.errors import InputError, LabelRoomError
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import LabelArt, label_arts
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.hulls.polygons import inscribed_box, signed_area
from dicedesign.geometry.sphere import rotation_between
from dicedesign.runtime.arrays import Floats

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
) -> tuple[list[float], list[Floats]]:
    """Inner lines of the border of a sunk field, one for each plane that meets that of the facet.

    frame: (4, 4) with the facet in its plane of x and y. Returns distances in mm from the origin
    and unit directions (2,): the field lies beyond.
    """
    others = np.delete(np.arange(len(hull.normals)), facet)
    normals, heights = hull.normals[others], hull.heights(frame[:3, 3])[others]
    cosines = normals @ hull.normals[facet]
    flat = -normals @ frame[:3, :2]
    sines = np.linalg.norm(flat, axis=1)
    meets = sines > LEAST_SINE
    widths = _walls(cosines[meets], options.depth_mm, options.border_mm)
    distances = widths - heights[meets] / sines[meets]
    return distances.tolist(), list(flat[meets] / sines[meets, None])


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
    `frame @ (height * x, height * y, 0, 1)` on the facet.

    Attributes
    ----------
    text: the label.
    frame: (4, 4) rigid motion from local x (right), y (up), z (out of the facet) to the body, in
        mm.
    height: digit height in mm.
    art: what it looks like, in digit heights.
    facet: index of the facet.
    growth: distance in mm by which its outlines move outward, for strokes wide enough.
    """

    text: str
    frame: Floats
    height: float
    art: LabelArt
    facet: int
    growth: float = 0.0

    @property
    def where(self) -> str:
        """The label and its facet, as messages call them."""
        return f"{self.text!r} on facet {self.facet}"

    def section(self) -> CrossSection:
        """The label in the plane of its facet, in mm about the origin of the frame.

        Raises EngravingError where its strokes cannot be as wide as asked for.
        """
        return self.art.cut(self.height, self.growth, f"label {self.where}")

    def moved(self, shift: Floats) -> Placement:
        """The same elsewhere, by a shift (3,) in mm."""
        frame = self.frame.copy()
        frame[:3, 3] += shift
        return replace(self, frame=frame)

    def stretched(self, matrix: Floats) -> Placement:
        """The same on a body that was stretched a little by a symmetric matrix (3, 3)."""
        frame = self.frame.copy()
        normal = np.asarray(np.linalg.solve(matrix, frame[:3, 2]), dtype=np.float64)
        frame[:3, :3] = rotation_between(self.frame[:3, 2], normal) @ frame[:3, :3]
        frame[:3, 3] = matrix @ frame[:3, 3]
        return replace(self, frame=frame)


def _fit(
    text: str,
    polygon: Floats,
    normal: Floats,
    facet: int,
    options: EngravingOptions,
    margins: float | Floats,
) -> tuple[Placement, float]:
    """The label as large as it fits, in any number of lines and of any upright that it may have,
    and by which factor the facet must grow, at least, for digits of `min_height_mm`."""
    polygon = np.asarray(polygon, dtype=np.float64)
    outward = np.asarray(normal, dtype=np.float64)
    if polygon.ndim != 2 or polygon.shape[1] != 3 or outward.shape != (3,) or not outward.any():
        raise InputError(
            f"facet {facet}: expected corners of shape (m, 3) and a normal of shape (3,) that is "
            f"not zero, got shape {polygon.shape} and normal {outward.tolist()}; correct them"
        )
    outward = outward / np.linalg.norm(outward)
    arts = label_arts(text, options)
    fits = [
        _fit_along(text, art, polygon, right, outward, facet, options, margins)
        for right in _rights(polygon, outward, options)
        for art in arts
    ]
    best = fits[0]
    for fit in fits[1:]:
        if fit[0].height > (1.0 + LONGER) * best[0].height:
            best = fit
    return best


def _rights(polygon: Floats, outward: Floats, options: EngravingOptions) -> list[Floats]:
    """Directions (3,) that may be right on a label, the preferred ones first."""
    if not isinstance(options.upright, str):
        up = np.array(options.upright) / np.linalg.norm(options.upright)
        right = np.cross(up, outward)
        length = float(np.linalg.norm(right))
        if length > STEEPEST:
            return [right / length]
    edges = np.roll(polygon, -1, axis=0) - polygon
    edges -= np.outer(edges @ outward, outward)
    lengths = np.linalg.norm(edges, axis=1)
    longest = int(lengths.argmax())
    if options.upright != "largest":
        return [edges[longest] / lengths[longest]]
    order = sorted(range(len(edges)), key=lambda k: (k != longest, -lengths[k]))
    return [edges[k] / lengths[k] for k in order if lengths[k] > LONGER * lengths[longest]]


def _fit_along(
    text: str,
    art: LabelArt,
    polygon: Floats,
    right: Floats,
    outward: Floats,
    facet: int,
    options: EngravingOptions,
    margins: float | Floats,
) -> tuple[Placement, float]:
    """As `_fit`, with a direction to the label's right."""
    up = np.cross(outward, right)
    origin = polygon.mean(axis=0)
    flat = (polygon - origin) @ np.column_stack([right, up])
    if signed_area(flat) < 0:
        raise InputError(
            f"facet {facet}: expected corners that run counter-clockwise seen from outside, got "
            "them clockwise; reverse them or turn the normal"
        )
    least, most = options.min_height_mm, options.max_height_mm
    growth = 0.0
    for _ in range(MOST_ROUNDS):
        center, height = inscribed_box(
            flat,
            art.size,
            margin=margins + growth,
            slack=CENTERING,
            least=least,
            most=most,
        )
        wanted = art.growth(height, options.stroke_mm) if height > 0.0 else growth
        if wanted <= growth:
            break
        # Smaller digits need to grow more.
        growth = min(wanted + LONGER * options.stroke_mm, 0.5 * options.stroke_mm)
    width, tall = art.size
    needed = 0.0
    if height < least:
        # A facet as many times as large has room for digits of the least height and the margin.
        rim = margins + 0.5 * options.stroke_mm
        needed = 1.0 / inscribed_box(flat, (width * least, tall * least), rim=rim)[1]
    left, bottom, far_right, top = art.box
    start = center - 0.5 * height * np.array([left + far_right, bottom + top])
    frame = np.eye(4)
    frame[:3] = np.column_stack([right, up, outward, origin + start[0] * right + start[1] * up])
    return Placement(text, frame, height, art, facet, growth), needed


def place_labels(
    texts: Sequence[str],
    polygons: Sequence[Floats],
    normals: Sequence[Floats] | Floats,
    facets: Sequence[int],
    options: EngravingOptions,
    size_mm: float,
    margins: Sequence[Floats] | None = None,
) -> list[Placement]:
    """Place labels on their facets, each as large as fits.

    A label's bounding box, the mark of an ambiguous one included, is nearly the largest upright
    rectangle of its proportions that keeps the margins from the edges of the facet, and nearly in
    the middle.

    Parameters
    ----------
    texts: k labels.
    polygons: k arrays (m, 3) in mm, convex facets or parts of facets, counter-clockwise seen from
        outside.
    normals: k arrays (3,), outward, of any length above 0.
    facets: k indices of the facets, for messages and placements.
    options: looks, sizes, upright and margin.
    size_mm: present largest distance between two vertices of the die, above 0.
    margins: k arrays (m,) of distances in mm from the edges of a polygon, each from a corner to the
        next, such as `edge_margins` gives; by default `options.margin_mm` from all.

    Returns
    -------
    list of k placements.

    Raises
    ------
    InputError: the sequences differ in length, a facet is clockwise or degenerate, size_mm is not
        above 0, or a font or an icon cannot be read.
    LabelRoomError: a label is too small to read. Of several the message is about that which needs
        the largest die; the size it gives does for all.
    EngravingError: a label cannot be drawn.
    """
    if not len(texts) == len(polygons) == len(normals) == len(facets):
        raise InputError(
            "labels: expected one polygon, one normal and one facet index for each, got "
            f"{len(texts)} labels, {len(polygons)} polygons, {len(normals)} normals and "
            f"{len(facets)} indices; pass as many of each"
        )
    if not (math.isfinite(size_mm) and size_mm > 0):
        raise InputError(f"size_mm: expected a finite number above 0, got {size_mm}; correct it")
    kept: Sequence[float | Floats] = [options.margin_mm] * len(texts)
    if margins is not None:
        kept = margins
    fits = [
        _fit(text, polygon, normal, facet, options, margin)
        for text, polygon, normal, facet, margin in zip(
            texts, polygons, normals, facets, kept, strict=True
        )
    ]
    placements = [placement for placement, _ in fits]
    rooms = []
    for placement in placements:
        width, tall = (placement.height * side for side in placement.art.size)
        room = f" in a rectangle of {width:.2f} by {tall:.2f} mm"
        rooms.append((f"label {placement.text!r}", f"facet {placement.facet}", room))
    heights = [placement.height for placement in placements]
    require_room(heights, [needed for _, needed in fits], rooms, size_mm, options)
    return placements


def require_room(
    heights: Sequence[float],
    needed: Sequence[float],
    rooms: Sequence[tuple[str, str, str]],
    size_mm: float,
    options: EngravingOptions,
) -> None:
    """Raise LabelRoomError if a label is too small to read: about that which needs the largest die,
    with a size of the die at which all are large enough.

    heights: k of digits, in mm; needed: k factors by which the die must grow for those that are too
    small; rooms: k times what messages call a label, what it is on, and more about its room there;
    size_mm: present largest distance between two vertices of the die.
    """
    small = [k for k, height in enumerate(heights) if height < options.min_height_mm]
    if not small:
        return
    worst = max(small, key=lambda k: needed[k])
    label, place, more = rooms[worst]
    size = (math.floor(10 * size_mm * needed[worst]) + 1) / 10
    raise LabelRoomError(
        f"{label}: expected room on {place} for digits of at least min_height_mm = "
        f"{options.min_height_mm:g}, got {heights[worst]:.2f} mm{more} ({len(small)} of "
        f"{len(heights)} {label.split()[0]}s are too small at size_mm = {size_mm:g}); use size_mm "
        f"= {size:.1f} or more, or a shorter label, a smaller margin_mm, depth_mm or min_height_mm",
        size,
    )
