"""Marks on a body of any shape: the outcome that it shows, on the side that is up when it lies so.

Lengths are in millimetres, volumes in cubic millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from manifold3d import Manifold
from scipy.ndimage import maximum_filter, minimum_filter

from dicedesign.errors import EngravingError, InputError
from dicedesign.fabricate.engraving import Cut, cut_out
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import LabelArt, label_arts
from dicedesign.fabricate.label_layout import require_room
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.manifold import solid
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers, ragged_ranges
from dicedesign.tolerances import ENGRAVED_VOLUME_TOLERANCE

STEEPEST: Final = 1.0
"""Slope of the surface beneath a mark, as rise over run."""

FLOOR: Final = 2.0
"""Thickness of the body beneath a mark before it is cut, in depths of the mark."""


SAMPLES: Final = 160
"""Nodes of a relief along the larger of its extents."""


@dataclass(frozen=True, eq=False)
class Relief:
    """Samples at the nodes of a square grid in the plane of x and y.

    Attributes
    ----------
    corner: (2,) x and y of the first node.
    spacing: between nodes.
    height: (a, b) z of the highest point of the body above each node, along x and y; -inf beside
        the body.
    thickness: (a, b) depth of the body from there down to where it ends or is hollow; 0 beside it.
    """

    corner: Floats
    spacing: float
    height: Floats
    thickness: Floats


@dataclass(frozen=True, eq=False)
class UpperSide:
    """A body turned so that the side to mark is up.

    Attributes
    ----------
    turn: (3, 3) rows right, up on the mark, and up from the table, in the body.
    points: (n, 3) of the body, turned: `body_points @ turn.T`.
    relief: of the turned body.
    """

    turn: Floats
    points: Floats
    relief: Relief

    def unevenness(self, depth: float, width: float, height: float) -> Floats:
        """(a, b) how far the surface rises and falls within a box of a width and a height about
        each node; inf where the box does not lie on the body or the body beneath it is steeper
        than 45 degrees or not solid to twice a depth."""
        good = self.relief.thickness >= FLOOR * depth
        z = np.pad(np.where(good, self.relief.height, np.nan), 1, constant_values=np.nan)
        reach = STEEPEST * self.relief.spacing
        along_x = np.abs(np.diff(z, axis=0))[:, 1:-1] <= reach
        along_y = np.abs(np.diff(z, axis=1))[1:-1] <= reach
        gentle = along_x[1:] & along_x[:-1] & along_y[:, 1:] & along_y[:, :-1]
        half = np.ceil(0.5 * np.array([width, height]) / self.relief.spacing).astype(np.int64)
        size = tuple((2 * half + 1).tolist())
        # Steep nodes are infinitely high, and so are those beyond the grid.
        low = minimum_filter(np.where(gentle, self.relief.height, np.inf), size)
        high = maximum_filter(
            np.where(gentle, self.relief.height, np.inf), size, cval=np.inf, mode="constant"
        )
        uneven = np.full(high.shape, np.inf)
        np.subtract(high, low, out=uneven, where=np.isfinite(high))
        return uneven


def upper_side(points: Floats, triangles: Integers, up: Floats) -> UpperSide:
    """A body of points (n, 3) and triangles (t, 3) with a unit direction (3,) up.

    Right is where the body is longest as seen from above.
    """
    flat = points - points.mean(axis=0)
    flat -= np.outer(flat @ up, up)
    right = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    right = right * np.sign(right[np.argmax(np.abs(right))])
    right -= up * (up @ right)
    right /= np.linalg.norm(right)
    turn = np.stack([right, np.cross(up, right), up])
    turned = points @ turn.T
    return UpperSide(turn, turned, relief(turned, triangles))


def relief(points: Floats, triangles: Integers) -> Relief:
    """The heights of a body of points (n, 3) and triangles (t, 3), at `SAMPLES` nodes along the
    larger of its extents along x and y."""
    low, extent = points[:, :2].min(axis=0), np.ptp(points[:, :2], axis=0)
    spacing = float(extent.max()) / SAMPLES
    shape = tuple((np.ceil(extent / spacing).astype(np.int64) + 2).tolist())
    # Off the points' own coordinates, so that nodes seldom lie on edges.
    corner = low - (np.sqrt(0.5), np.sqrt(0.3)) * np.array([spacing, spacing])
    grid = np.column_stack([(points[:, :2] - corner) / spacing, points[:, 2]])[triangles]
    # Upright triangles hide nothing.
    a, b, c = grid.transpose(1, 0, 2)
    grid = grid[_areas(a, b, c) != 0.0]
    first = np.ceil(grid[..., :2].min(axis=1)).astype(np.int64)
    count = np.floor(grid[..., :2].max(axis=1)).astype(np.int64) - first + 1
    owner, place = ragged_ranges(np.zeros(len(grid), dtype=np.int64), count.clip(0).prod(axis=1))
    row, column = first[owner].T + np.stack(np.divmod(place, count[owner, 1]))
    a, b, c = grid[owner].transpose(1, 0, 2)
    node = np.stack([row, column], axis=-1)
    one, other = np.stack([_areas(node, b, c), _areas(a, node, c)]) / _areas(a, b, c)
    hit = (one >= 0.0) & (other >= 0.0) & (one + other <= 1.0)
    z = (one * a[:, 2] + other * b[:, 2] + (1.0 - one - other) * c[:, 2])[hit]
    key = np.ravel_multi_index((row[hit], column[hit]), shape)

    # The highest two surfaces above each node: the body lies between them.
    order = np.lexsort((-z, key))
    key, z = key[order], z[order]
    fresh = np.diff(key, prepend=-1) != 0
    top = np.flatnonzero(fresh)
    second = np.flatnonzero(fresh[:-1] & ~fresh[1:])
    height, thickness = np.full(shape, -np.inf), np.zeros(shape)
    height.ravel()[key[top]] = z[top]
    thickness.ravel()[key[second]] = z[second] - z[second + 1]
    return Relief(corner, spacing, height, thickness)


def _areas(a: Floats, b: Floats, c: Floats) -> Floats:
    """Twice the signed areas (...) of triangles as seen from above, z being ignored."""
    u, v = b[..., :2] - a[..., :2], c[..., :2] - a[..., :2]
    doubled: Floats = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return doubled


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
        turned = plain.transform(np.column_stack([side.turn, np.zeros(3)]))
        mark, cut = _fit(side, turned, text, marks, options)
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
    side: UpperSide, turned: Manifold, text: str, others: Sequence[Mark], options: EngravingOptions
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
            cut = _cut(turned, mark, middle, options)
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


def _cut(body: Manifold, mark: Mark, middle: Floats, options: EngravingOptions) -> Cut | None:
    """The outlines of a mark cut out of the surface of a turned body; None where that is no whole
    sheet there. The cut ends where the body does that is moved down by the depth of the mark."""
    depth = options.depth_mm
    section = mark.art.cut(mark.height, mark.growth, f"mark {mark.text!r}")
    left, bottom, right, top = (mark.height * edge for edge in mark.art.box)
    x, y = middle[0] - 0.5 * (left + right), middle[1] - 0.5 * (bottom + top)
    low, high = body.bounding_box()[2] - 2.0 * depth, body.bounding_box()[5] + depth
    prism = section.extrude(high - low).translate((x, y, low))
    left_over = (prism - body.translate((0.0, 0.0, -depth))).decompose()
    # Other parts are below the body or in its hollows.
    cutter = Manifold.compose([part for part in left_over if part.bounding_box()[5] > high - depth])
    volume = section.area() * depth
    if abs((cutter ^ body).volume() - volume) > ENGRAVED_VOLUME_TOLERANCE * volume:
        return None
    back = np.column_stack([mark.frame[:3, :3], np.zeros(3)])
    return Cut(repr(mark.text), cutter.transform(back), volume)
