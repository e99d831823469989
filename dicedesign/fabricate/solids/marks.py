"""Marks on a body of any shape: the outcome that it shows, on the side that is up when it lies so.

Lengths are in millimetres, volumes in cubic millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.labels.label_art import LabelArt, label_arts
from dicedesign.fabricate.labels.layout import require_room
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.fabricate.solids.engraving import Cut, cut_out
from dicedesign.fabricate.solids.upper_side import UpperSide, upper_side
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.manifold import solid
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import ENGRAVED_VOLUME_TOLERANCE

__all__ = ["Mark", "engrave_marks"]

CLEARANCE: Final = 0.25
"""Distance that a cut reaches above the surface, in depths of the mark."""

SHRINKING: Final = 0.85
"""Ratio of the digit heights tried one after the other."""

SMALLEST: Final = 3.0
"""Smallest digit height tried, in spacings of the relief."""

EVENNESS: Final = 2.0
"""Millimetres of the height of its digits that a millimetre counts for by which the surface rises
and falls beneath a mark."""

PLACES: Final = 3
"""Places tried of one digit height: one may have a flaw between the nodes of the relief."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A label on the upper side of a body that lies on one of its outcomes.

    Attributes
    ----------
    text: the label.
    frame: (4, 4) rigid motion from local x (right), y (up) and z (from the table upward) to the
        body; its origin is the point of the surface beneath the middle of the label.
    height: digit height.
    art: what it looks like, in digit heights.
    growth: distance by which its outlines move outward, for strokes wide enough.
    """

    text: str
    frame: Floats
    height: float
    art: LabelArt
    growth: float = 0.0


def engrave_marks(
    vertices: Floats,
    triangles: Integers,
    downs: Floats,
    texts: Sequence[str],
    options: EngravingOptions,
) -> tuple[Surface, list[Mark]]:
    """Engrave a label for each outcome on the side that is up when the body lies on it.

    Each label lies on a part of the surface that is seen straight from above, nowhere steeper than
    45 degrees, solid to twice the depth, and away from the labels before it. Of all such places it
    takes one where it is large (`options.max_height_mm` at most), high above the table and even.
    The outlines are cut straight down, everywhere `options.depth_mm` below the surface. A label of
    "●" is a dot.

    Parameters
    ----------
    vertices: (n, 3) of the plain solid.
    triangles: (t, 3) counter-clockwise seen from outside; closed.
    downs: (k, 3) directions in the body that point to the table, of any length above 0.
    texts: k labels.
    options: looks, depth, sizes, and how much room a label keeps free; `upright` says nothing here.

    Returns
    -------
    Surface that passed the checks of `engrave`, and k marks in the order of the labels.

    Raises
    ------
    InputError: the plain mesh is no solid, or there is not one direction for each label.
    LabelRoomError: a label is too small to read; at the size it gives all are large enough.
    EngravingError: there is no place for a label at any size, or a check failed.
    """
    downs = np.asarray(downs, dtype=np.float64)
    lengths = np.linalg.norm(downs, axis=-1)
    if downs.shape != (len(texts), 3) or not (np.isfinite(lengths) & (lengths > 0.0)).all():
        raise InputError(
            f"marks: expected a finite direction that is not zero for each of {len(texts)} labels, "
            f"got {downs.tolist()}; pass one (3,) for each"
        )
    plain = solid(vertices, triangles)
    points, corners = np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64)
    marks: list[Mark] = []
    cuts: list[Cut] = []
    for text, down in zip(texts, downs, strict=True):
        side = upper_side(points, corners, -down / np.linalg.norm(down))
        mark, cut = _fit(side, text, marks, options)
        marks.append(mark)
        cuts.append(cut)
    heights = [mark.height for mark in marks]
    require_room(
        heights,
        [options.min_height_mm / height for height in heights],
        [(f"mark {mark.text!r}", "the upper side", "") for mark in marks],
        convex_hull(points).diameter,
        options,
    )
    return cut_out(plain, cuts, options), marks


def _fit(
    side: UpperSide, text: str, others: Sequence[Mark], options: EngravingOptions
) -> tuple[Mark, Cut]:
    """The best mark of a label and its cut; it is too small to read where nothing else fits."""
    # Of several lines, the shape that is nearest to a square.
    art = min(label_arts(text, options), key=lambda each: math.hypot(*each.size))
    for legible in (True, False):
        places = _places(side, art, others, options, legible)
        for middle, height in places:
            frame = np.eye(4)
            frame[:3] = np.column_stack([side.turn.T, middle @ side.turn])
            mark = Mark(text, frame, height, art, art.growth(height, options.stroke_mm))
            cut = _cut(side, mark, middle, options)
            if cut is not None:
                return mark, cut
    raise EngravingError(
        f"mark {text!r}: expected a place on the upper side that is seen from above, at most 45 "
        f"degrees steep and solid to {2 * options.depth_mm:g} mm, got none of any size; reduce "
        f"depth_mm (now {options.depth_mm:g}) or increase size_mm"
    )


def _places(
    side: UpperSide,
    art: LabelArt,
    others: Sequence[Mark],
    options: EngravingOptions,
    legible: bool,
) -> list[tuple[Floats, float]]:
    """Middles (3,), turned, and digit heights of places for a label, the best first.

    legible: whether digit heights from the largest down to `min_height_mm` are tried, or those
    below until one has a place.
    """
    grid = side.relief
    x, y = (grid.corner[k] + grid.spacing * np.arange(grid.height.shape[k]) for k in range(2))
    centers = np.stack([*np.meshgrid(x, y, indexing="ij"), grid.height], axis=-1)
    low, high = side.points[:, 2].min(), side.points[:, 2].max()
    rise = (grid.height - low) / (high - low)
    clear = [
        np.linalg.norm(centers - side.turn @ other.frame[:3, 3], axis=-1)
        - 0.5 * math.hypot(*_room(other.art, other.height, other.growth, options))
        for other in others
    ]
    places = []
    for height in _digit_heights(options, legible, SMALLEST * grid.spacing):
        width, tall = _room(art, height, art.growth(height, options.stroke_mm), options)
        uneven = side.unevenness(options.depth_mm, width, tall)
        good = np.isfinite(uneven)
        for distance in clear:
            good &= distance > 0.5 * math.hypot(width, tall) + options.depth_mm
        score = height * (1.0 + rise) - EVENNESS * uneven
        for _ in range(PLACES):
            if not good.any():
                break
            score[~good] = -np.inf
            best = np.unravel_index(np.argmax(score), score.shape)
            places.append((float(score[best]), centers[best], height))
            good &= np.linalg.norm((centers - centers[best])[..., :2], axis=-1) > 0.5 * height
        if places and not legible:
            break
    places.sort(key=lambda place: -place[0])
    return [place[1:] for place in places]


def _digit_heights(options: EngravingOptions, legible: bool, smallest: float) -> list[float]:
    """The digit heights to try, falling."""
    largest, least = (
        (options.max_height_mm, options.min_height_mm)
        if legible
        else (SHRINKING * options.min_height_mm, smallest)
    )
    if largest < least:
        return []
    steps = math.ceil(math.log(least / largest) / math.log(SHRINKING))
    return [*(largest * SHRINKING**k for k in range(steps)), least]


def _room(
    art: LabelArt, height: float, growth: float, options: EngravingOptions
) -> tuple[float, float]:
    """Width and height of a label of a digit height and of what it keeps free around it: the
    margin, or for one too small to read what the margin would be on a die as large as it needs."""
    width, tall = art.size
    rim = 2.0 * (growth + options.margin_mm * min(1.0, height / options.min_height_mm))
    return height * width + rim, height * tall + rim


def _cut(side: UpperSide, mark: Mark, middle: Floats, options: EngravingOptions) -> Cut | None:
    """The outlines of a mark cut out of the surface; None where it is no whole sheet there."""
    above, depth = CLEARANCE * options.depth_mm, options.depth_mm
    room = _room(mark.art, mark.height, mark.growth, options)
    layer = side.layer(middle, *room, above, depth)
    if layer is None:
        return None
    section = mark.art.cut(mark.height, mark.growth, f"mark {mark.text!r}")
    left, bottom, right, top = (mark.height * edge for edge in mark.art.box)
    low, high = layer.bounding_box()[2], layer.bounding_box()[5]
    prism = section.extrude(high - low + 2.0 * depth).translate(
        (middle[0] - 0.5 * (left + right), middle[1] - 0.5 * (bottom + top), low - depth)
    )
    cutter = layer ^ prism
    whole = section.area() * (above + depth)
    if abs(cutter.volume() - whole) > ENGRAVED_VOLUME_TOLERANCE * whole:
        return None
    back = np.column_stack([side.turn.T, np.zeros(3)])
    return Cut(repr(mark.text), cutter.transform(back), section.area() * depth)
