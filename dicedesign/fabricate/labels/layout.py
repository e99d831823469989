"""Places of labels on facets: middle, size and upright.

Lengths are in millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from dicedesign.errors import InputError, LabelRoomError
from dicedesign.fabricate.labels.glyphs import text_section
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.geometry.hulls.polygons import inscribed_circle, signed_area
from dicedesign.geometry.sphere import rotation_between
from dicedesign.runtime.arrays import Floats

__all__ = ["Placement", "place_labels", "require_room"]

CENTERING: Final = 0.12
"""Part of the inscribed radius given up to bring a label nearer to the middle of its facet."""


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
    """

    text: str
    frame: Floats
    height: float

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
    text: str, polygon: Floats, normal: Floats, facet: int, options: EngravingOptions
) -> tuple[Placement, float]:
    """The label as large as it fits, and the radius of the circle it fits in."""
    polygon = np.asarray(polygon, dtype=np.float64)
    outward = np.asarray(normal, dtype=np.float64)
    if polygon.ndim != 2 or polygon.shape[1] != 3 or outward.shape != (3,) or not outward.any():
        raise InputError(
            f"facet {facet}: expected corners of shape (m, 3) and a normal of shape (3,) that is "
            f"not zero, got shape {polygon.shape} and normal {outward.tolist()}; correct them"
        )
    outward = outward / np.linalg.norm(outward)
    edges = np.roll(polygon, -1, axis=0) - polygon
    edges -= np.outer(edges @ outward, outward)
    lengths = np.linalg.norm(edges, axis=1)
    right = edges[lengths.argmax()] / lengths.max()
    up = np.cross(outward, right)
    origin = polygon.mean(axis=0)
    flat = (polygon - origin) @ np.column_stack([right, up])
    if signed_area(flat) < 0:
        raise InputError(
            f"facet {facet}: expected corners that run counter-clockwise seen from outside, got "
            "them clockwise; reverse them or turn the normal"
        )
    center, radius = inscribed_circle(flat, CENTERING)
    left, bottom, far_right, top = text_section(text).bounds()
    height = (1 - options.margin) * 2 * radius / math.hypot(far_right - left, top - bottom)
    height = min(height, options.max_height_mm)
    start = center - 0.5 * height * np.array([left + far_right, bottom + top])
    frame = np.eye(4)
    frame[:3] = np.column_stack([right, up, outward, origin + start[0] * right + start[1] * up])
    return Placement(text, frame, height), radius


def place_labels(
    texts: Sequence[str],
    polygons: Sequence[Floats],
    normals: Sequence[Floats] | Floats,
    facets: Sequence[int],
    options: EngravingOptions,
    size_mm: float,
) -> list[Placement]:
    """Place labels on their facets, each as large as fits.

    A label's bounding box, bar included, is centred on a circle in the facet, nearly the largest
    and nearly in the middle, and fits within that circle less the margin. The longest edge of the
    facet is at the bottom of the text.

    Parameters
    ----------
    texts: k labels.
    polygons: k arrays (m, 3) in mm, convex facets, counter-clockwise seen from outside.
    normals: k arrays (3,), outward, of any length above 0.
    facets: k indices of the facets, for messages and placements.
    options: sizes and margin.
    size_mm: present largest distance between two vertices of the die, above 0.

    Returns
    -------
    list of k placements.

    Raises
    ------
    InputError: the sequences differ in length, a facet is clockwise or degenerate, or size_mm is
        not above 0.
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
    fits = [
        _fit(text, polygon, normal, facet, options)
        for text, polygon, normal, facet in zip(texts, polygons, normals, facets, strict=True)
    ]
    require_room(
        [placement.height for placement, _ in fits],
        [
            (f"label {text!r}", f"facet {facet}", f" in its circle of diameter {2 * radius:.2f} mm")
            for text, facet, (_, radius) in zip(texts, facets, fits, strict=True)
        ],
        size_mm,
        options,
    )
    return [placement for placement, _ in fits]


def require_room(
    heights: Sequence[float],
    rooms: Sequence[tuple[str, str, str]],
    size_mm: float,
    options: EngravingOptions,
) -> None:
    """Raise LabelRoomError if a label is too small to read: about the smallest, with a size of the
    die at which all are large enough.

    heights: k of digits, in mm; rooms: k times what messages call a label, what it is on, and more
    about its room there; size_mm: present largest distance between two vertices of the die.
    """
    few = sum(height < options.min_height_mm for height in heights)
    if few == 0:
        return
    least = min(heights)
    label, place, more = rooms[list(heights).index(least)]
    needed = (math.floor(10 * size_mm * options.min_height_mm / least) + 1) / 10
    raise LabelRoomError(
        f"{label}: expected room on {place} for digits of at least min_height_mm = "
        f"{options.min_height_mm:g}, got {least:.2f} mm{more} ({few} of {len(heights)} "
        f"{label.split()[0]}s are too small at size_mm = {size_mm:g}); use size_mm = {needed:.1f} "
        "or more, or a shorter label, a smaller margin or a smaller min_height_mm",
        needed,
    )
