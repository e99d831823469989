"""Marks on a body of any shape: labels of its outcomes, on the side that is up in each.

Lengths are in millimeters, volumes in cubic millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold
from scipy.ndimage import maximum_filter, minimum_filter

from dicedesign.errors import EngravingError
from dicedesign.fabricate.engraving import LabelCut, cut_out
from dicedesign.fabricate.finish_options import EngravingOptions
from dicedesign.fabricate.label_art import LabelArt, label_arts
from dicedesign.fabricate.label_layout import Placement, require_room
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.manifold import solid
from dicedesign.geometry.sphere import rigid_motion
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import ENGRAVED_VOLUME_TOLERANCE

STEEPEST = 1.0
"""Largest slope of the surface beneath a mark, as rise over run."""

FLOOR = 2.0
"""Least thickness of the body beneath a mark before it is cut, over the depth of the mark."""

SAMPLES = 160
"""Number of nodes of a relief along the larger of its extents."""

SHRINKING = 0.85
"""Ratio of consecutive digit heights of the search."""

SMALLEST = 3.0
"""Smallest digit height of the search, in spacings of the relief."""

EVENNESS = 2.0
"""Digit height that a mark gives up for a flatter place, per height difference beneath it."""

PLACES = 3
"""Number of candidate places of a digit height: one may have a flaw between nodes of the relief."""


@dataclass(frozen=True, eq=False)
class Relief:
    """Heights of a body at the nodes of a square grid in the plane of x and y.

    Attributes
    ----------
    corner: (2,) x and y of the first node.
    spacing: between nodes.
    height: (a, b) z of the highest point of the body at each node, along x and y; -inf beside the
        body.
    thickness: (a, b) of the body from there down to its end or a hollow; 0 beside it.
    """

    corner: Floats
    spacing: float
    height: Floats
    thickness: Floats

    def nodes(self) -> Floats:
        """(a, b, 3) points of the surface."""
        indices = np.moveaxis(np.indices(self.height.shape), 0, -1)
        places = self.corner + self.spacing * indices
        return np.concatenate([places, self.height[..., None]], axis=-1)

    def unevenness(self, depth: float, size: Floats) -> Floats:
        """(a, b) height difference of the surface within a box of a width and a height (2,) about
        each node; inf if the box extends beyond the body, or the body beneath it is steeper than 45
        degrees or not solid to twice a depth."""
        good = self.thickness >= FLOOR * depth
        z = np.pad(np.where(good, self.height, np.nan), 1, constant_values=np.nan)
        reach = STEEPEST * self.spacing
        along_x = np.abs(np.diff(z, axis=0))[:, 1:-1] <= reach
        along_y = np.abs(np.diff(z, axis=1))[1:-1] <= reach
        gentle = along_x[1:] & along_x[:-1] & along_y[:, 1:] & along_y[:, :-1]
        # Steep nodes and those beyond the grid are infinitely high.
        z = np.where(gentle, self.height, np.inf)
        box = tuple(2 * np.ceil(0.5 * size / self.spacing).astype(np.int64) + 1)
        high = maximum_filter(z, box, cval=np.inf, mode="constant")
        low = minimum_filter(z, box)
        return np.subtract(high, low, out=np.full(z.shape, np.inf), where=np.isfinite(high))


def relief(body: Manifold) -> Relief:
    """Sample the heights of a body at `SAMPLES` nodes along the larger of its extents in x and
    y."""
    box = np.reshape(body.bounding_box(), (2, 3))
    extent = np.ptp(box[:, :2], axis=0)
    spacing = float(extent.max()) / SAMPLES
    # Nodes are off the coordinates of points, so that they seldom lie on edges.
    corner = box[0, :2] - (np.sqrt(0.5), np.sqrt(0.3)) * np.array([spacing, spacing])
    shape = tuple((np.ceil(extent / spacing).astype(np.int64) + 2).tolist())
    height, thickness = np.full(shape, -np.inf), np.zeros(shape)
    for node in np.ndindex(shape):
        x, y = corner + spacing * np.array(node)
        hits = body.ray_cast((x, y, box[1, 2] + spacing), (x, y, box[0, 2] - spacing))
        if len(hits) > 1:
            height[node] = hits[0].position[2]
            thickness[node] = height[node] - hits[1].position[2]
    return Relief(corner, spacing, height, thickness)


def engrave_marks(
    surface: Surface,
    downs: Floats,
    texts: Sequence[str],
    options: EngravingOptions,
) -> tuple[Surface, list[Placement]]:
    """Engrave a label for each outcome on the side that is up.

    Each label is on a part of the surface that is visible straight from above, nowhere steeper than
    45 degrees, solid to twice the depth, and apart from earlier labels. Among such places it takes
    one where it is large (`options.max_height_mm` at most), high above the table and on even
    ground. The outlines are cut straight down, everywhere `options.depth_mm` below the surface.

    Parameters
    ----------
    surface: of the plain solid.
    downs: (k, 3) directions in the body that point to the table, of any length above 0.
    texts: k labels.
    options: look, depth, sizes and margin; `upright` does not apply.

    Returns
    -------
    Surface that passed the checks of `engrave`, and k placements in the order of the labels; the
    origin of each is the point of the surface beneath the middle of the label.

    Raises
    ------
    InputError: the plain mesh is no solid.
    LabelRoomError: a label is too small to read; at the size it gives all are large enough.
    EngravingError: there is no place for a label at any size, or a check failed.
    """
    plain, vertices = solid(surface), surface.points
    marks: list[Placement] = []
    cuts: list[LabelCut] = []
    for text, down in zip(texts, downs, strict=True):
        turn = _upright(vertices, -down / np.linalg.norm(down))
        turned = plain.transform(np.column_stack([turn, np.zeros(3)]))
        view, z = relief(turned), vertices @ turn[2]
        rise = (view.height - z.min()) / np.ptp(z)
        # The line breaks without hyphens whose shape is most nearly square.
        arts = label_arts(text, options, texts)
        art = min(arts, key=lambda each: (each.hyphens, math.hypot(*each.size)))
        for middle, height in _places(view, turn, rise, art, marks, options):
            growth = art.growth(height, options.stroke_mm)
            frame = rigid_motion(turn.T, middle @ turn)
            mark = Placement(text, frame, height, art, growth=growth)
            cut = _cut(turned, mark, middle, options.depth_mm)
            if cut is not None:
                break
        else:
            raise EngravingError(
                f"mark {text!r}: expected a place on the upper side that is seen from above, at "
                f"most 45 degrees steep and solid to {2 * options.depth_mm:g} mm, got none of any "
                f"size; reduce depth_mm (now {options.depth_mm:g}) or increase size_mm"
            )
        marks.append(mark)
        cuts.append(cut)
    needed = [options.min_height_mm / mark.height for mark in marks]
    require_room(marks, needed, convex_hull(vertices).diameter, options)
    return cut_out(plain, cuts, options), marks


def _upright(points: Floats, up: Floats) -> Floats:
    """(3, 3) frame of a mark on a body of points (n, 3), with rows right, up on the mark, and up
    from the table, a unit direction (3,). Seen from above the body is longest to the right."""
    flat = points - points.mean(axis=0)
    flat -= np.outer(flat @ up, up)
    right = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    right = right * np.sign(right[np.argmax(np.abs(right))])
    right -= up * (up @ right)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(up, right), up])


def _places(
    view: Relief,
    turn: Floats,
    rise: Floats,
    art: LabelArt,
    others: Sequence[Placement],
    options: EngravingOptions,
) -> Iterator[tuple[Floats, float]]:
    """Yield turned middles (3,) and digit heights of places for a label, the best first: all
    heights down to `min_height_mm`, then the largest smaller one that has a place.

    turn: of the body; rise: (a, b) height of the surface above the table, over the body's height.
    """
    nodes = view.nodes()
    clear = [
        np.linalg.norm(nodes - turn @ other.origin, axis=-1)
        - 0.5 * math.hypot(*_room(other.art, other.height, other.growth, options))
        for other in others
    ]
    least = options.min_height_mm
    for heights in (
        _digit_heights(options.max_height_mm, least),
        _digit_heights(SHRINKING * least, SMALLEST * view.spacing),
    ):
        places = []
        for height in heights:
            size = _room(art, height, art.growth(height, options.stroke_mm), options)
            uneven = view.unevenness(options.depth_mm, size)
            good = np.isfinite(uneven)
            for distance in clear:
                good &= distance > 0.5 * math.hypot(*size) + options.depth_mm
            score = height * (1.0 + rise) - EVENNESS * uneven
            for _ in range(PLACES):
                if not good.any():
                    break
                score[~good] = -np.inf
                best = np.unravel_index(np.argmax(score), score.shape)
                places.append((float(score[best]), nodes[best], height))
                good &= np.linalg.norm((nodes - nodes[best])[..., :2], axis=-1) > 0.5 * height
            if places and height < least:
                break
        for _, middle, height in sorted(places, key=lambda place: -place[0]):
            yield middle, height


def _digit_heights(largest: float, least: float) -> list[float]:
    """Digit heights of the search, in descending order."""
    if largest < least:
        return []
    steps = math.ceil(math.log(least / largest) / math.log(SHRINKING))
    return [*(largest * SHRINKING**k for k in range(steps)), least]


def _room(art: LabelArt, height: float, growth: float, options: EngravingOptions) -> Floats:
    """(2,) width and height of a label of a digit height with its margin, which shrinks with a
    label that is too small to read."""
    rim = growth + options.margin_mm * min(1.0, height / options.min_height_mm)
    return height * np.array(art.size) + 2.0 * rim


def _cut(body: Manifold, mark: Placement, middle: Floats, depth: float) -> LabelCut | None:
    """Cut of the outlines of a mark into a turned body, down to a copy of the body that is lower by
    the depth of the mark; None if that is no whole sheet."""
    section = mark.section()
    left, bottom, right, top = mark.height * np.array(mark.art.box)
    x, y = middle[0] - 0.5 * (left + right), middle[1] - 0.5 * (bottom + top)
    low, high = body.bounding_box()[2] - 2.0 * depth, body.bounding_box()[5] + depth
    prism = section.extrude(high - low).translate((x, y, low))
    left_over = (prism - body.translate((0.0, 0.0, -depth))).decompose()
    # Lower parts are below the body or in its hollows.
    cutter = Manifold.compose([part for part in left_over if part.bounding_box()[5] > high - depth])
    volume = section.area() * depth
    if abs((cutter ^ body).volume() - volume) > ENGRAVED_VOLUME_TOLERANCE * volume:
        return None
    back = np.column_stack([mark.frame[:3, :3], np.zeros(3)])
    return LabelCut(repr(mark.text), cutter.transform(back), volume)
