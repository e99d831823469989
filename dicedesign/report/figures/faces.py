"""Every face of the die, flat and true to scale, with what is cut into it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.polygons import signed_area
from dicedesign.report.charts.palette import DARK, FAINT
from dicedesign.report.charts.paper import NOTE, Paper
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.runtime.arrays import Floats

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.results.result import Result

__all__ = ["Face", "faces_figure", "faces_of"]

_CELL: Final = 210
"""Pixels of the widest or tallest face."""

_GAP: Final = 26

_TITLE: Final = 34

_COLUMNS: Final = 6

_MOST: Final = 60
"""Faces up to which those without a label are drawn too."""

_FACE: Final = "#e6eaee"

_BARS: Final = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Lengths of a scale bar, in mm; the longest that is not longer than a face is taken."""


@dataclass(frozen=True, eq=False)
class Face:
    """A face seen straight from outside, in mm.

    Attributes
    ----------
    outline: (m, 2) its corners.
    cuts: contours (n, 2) of its labels: outer ones counter-clockwise, holes clockwise.
    title: above it.
    """

    outline: Floats
    cuts: tuple[Floats, ...]
    title: str


def faces_of(
    hull: ConvexHull, placements: Sequence[Placement], titles: dict[int, str]
) -> list[Face]:
    """The faces of a die: those with labels, in the order of the labels, then the others where
    there are few.

    hull: the die in mm; placements: of its labels; titles: by facet.
    """
    on_facet: dict[int, list[Placement]] = {}
    for placement in placements:
        on_facet.setdefault(_facet_of(hull, placement.frame), []).append(placement)
    blank = [facet for facet in range(len(hull.normals)) if facet not in on_facet]
    faces = []
    for facet, own in on_facet.items():
        frame = own[0].frame
        cuts = [
            _flat(frame, _lifted(placement.frame, np.asarray(contour)))
            for placement in own
            for contour in placement.section().to_polygons()
        ]
        title = titles.get(facet, "")
        faces.append(Face(_flat(frame, hull.polygon(facet)), tuple(cuts), title))
    if len(on_facet) + len(blank) <= _MOST:
        for facet in blank:
            outline = _flat(_resting_frame(hull, facet), hull.polygon(facet))
            faces.append(Face(outline, (), titles.get(facet, "")))
    return faces


def _facet_of(hull: ConvexHull, frame: Floats) -> int:
    """The facet in whose plane a frame lies, as nearly as any."""
    normal, place = frame[:3, 2], frame[:3, 3]
    turned = 1.0 - hull.normals @ normal
    nearest = np.flatnonzero(turned <= turned.min() + 1e-6)
    away = [abs((hull.polygon(k) - place) @ normal).max() for k in nearest.tolist()]
    return int(nearest[int(np.argmin(away))])


def _resting_frame(hull: ConvexHull, facet: int) -> Floats:
    """Frame of a facet with its longest edge to the right."""
    polygon, normal = hull.polygon(facet), hull.normals[facet]
    edges = np.roll(polygon, -1, axis=0) - polygon
    right = edges[np.linalg.norm(edges, axis=1).argmax()]
    right = right / np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3] = np.column_stack([right, np.cross(normal, right), normal, polygon[0]])
    return frame


def _flat(frame: Floats, points: Floats) -> Floats:
    """Points (n, 3) of the body in the plane of a frame (n, 2)."""
    flat: Floats = (points - frame[:3, 3]) @ frame[:3, :2]
    return flat


def _lifted(frame: Floats, flat: Floats) -> Floats:
    points: Floats = frame[:3, 3] + flat @ frame[:3, :2].T
    return points


def faces_figure(faces: Sequence[Face]) -> Paper:
    """Faces side by side, all on one scale, and a bar of so many millimetres.

    Raises InputError: there is no face.
    """
    if not faces:
        raise InputError("faces: expected at least one, got none; pass those of a die")
    extents = np.array([np.ptp(face.outline, axis=0) for face in faces])
    scale = _CELL / float(extents.max())
    columns = min(_COLUMNS, len(faces))
    rows = [range(k, min(k + columns, len(faces))) for k in range(0, len(faces), columns)]
    heights = [scale * float(extents[list(row), 1].max()) for row in rows]
    width = columns * (_CELL + _GAP) + _GAP
    paper = Paper(width, sum(heights) + len(rows) * (_TITLE + _GAP) + 3 * _GAP)
    top = float(_GAP)
    for row, height in zip(rows, heights, strict=True):
        for column, number in enumerate(row):
            middle = _GAP + column * (_CELL + _GAP) + 0.5 * _CELL
            face = faces[number]
            if face.title:
                paper.text(face.title, (middle, top + _TITLE - 8.0), size=NOTE, anchor="md")
            _draw_face(paper, face, scale, (middle, top + _TITLE + 0.5 * height))
        top += _TITLE + height + _GAP
    _draw_bar(paper, scale, (float(_GAP), top + 0.5 * _GAP))
    return paper


def _draw_face(paper: Paper, face: Face, scale: float, middle: tuple[float, float]) -> None:
    low, high = face.outline.min(axis=0), face.outline.max(axis=0)

    def placed(points: Floats) -> Floats:
        flat: Floats = np.array(middle) + scale * (points - 0.5 * (low + high)) * (1.0, -1.0)
        return flat

    paper.polygon(placed(face.outline), _FACE)
    paper.line(placed(np.vstack([face.outline, face.outline[:1]])), FAINT, 1.5)
    # Holes lie within what they are cut from, and are smaller.
    for contour in sorted(face.cuts, key=lambda contour: -abs(signed_area(contour))):
        paper.polygon(placed(contour), DARK if signed_area(contour) > 0.0 else _FACE)


def _draw_bar(paper: Paper, scale: float, place: tuple[float, float]) -> None:
    length = max((bar for bar in _BARS if bar * scale <= _CELL), default=_BARS[0])
    x, y = place
    ends = [(x, y), (x + scale * length, y)]
    paper.line(ends, DARK, 2.0)
    for end, _ in ends:
        paper.line([(end, y - 5.0), (end, y + 5.0)], DARK, 2.0)
    paper.text(f"{length:g} mm", (ends[1][0] + 10.0, y), size=NOTE, anchor="lm")


def _titles(die: FinishedDie, hull: ConvexHull) -> dict[int, str]:
    """What each labelled facet says, and how often that comes up; how often the die rests on those
    that count for nothing."""
    assert die.engraved is not None
    result, titles = die.result, {}
    for facet in result.facets:
        if facet.outcome is None:
            flat = int(np.argmax(hull.normals @ np.array(facet.normal)))
            titles[flat] = f"other: {_percent(facet.probability)}"
    shares = dict(zip(result.labels, _shares(result), strict=True))
    several = Counter(_facet_of(hull, label.frame) for label in die.engraved.placements)
    for placement in die.engraved.placements:
        flat = _facet_of(hull, placement.frame)
        if several[flat] == 1:
            titles[flat] = f"{placement.text}: {_percent(shares[placement.text])}"
    return titles


def _shares(result: Result) -> tuple[float, ...]:
    """(k,) odds of the outcomes that the die is meant for."""
    if result.thrown is None:
        return result.probabilities
    seen = result.thrown.simulated
    return result.thrown.momentum if seen is None else seen.frequencies


def _percent(share: float) -> str:
    digits = 1 if share <= 0.0 else max(0, min(3, 1 - math.floor(math.log10(100.0 * share))))
    return f"{100.0 * share:.{digits}f} %"


def _draw(die: FinishedDie) -> bytes:
    assert die.engraved is not None
    hull = die.engraved.core or die.plain.poses.hull
    return faces_figure(faces_of(hull, die.engraved.placements, _titles(die, hull))).png()


FIGURES.register(
    Figure(
        name="faces",
        line="every face flat and true to scale, with its label as it is cut",
        rank=60,
        title="Every face",
        caption=(
            "Each face seen straight from outside, all on one scale, with its label as it is cut. "
            "Above it is what it says, and how often that comes up; around a corner on top each "
            "face says several things. Rounded edges are left out."
        ),
        wanted=lambda die: die.engraved is not None and len(die.engraved.placements) > 0,
        draw=_draw,
    )
)
