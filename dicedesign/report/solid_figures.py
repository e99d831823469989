"""Figures of dice with flat faces: views, faces, how the die is read, how it is best printed."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.report.palette import ACCENT, DARK, FAINT, rgb
from dicedesign.report.render.pictures import trim
from dicedesign.report.render.raster import Camera, camera_on, framed
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.report.render.tabletop import render_on_table, with_shadow
from dicedesign.report.sheet import NOTE, Sheet, picture_grid, styled
from dicedesign.runtime.arrays import Booleans, Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.fabricate.label_layout import LabelPlace, Placement

PIXELS: Final = 400

VIEW_PIXELS: Final = 320

SIDES: Final[dict[str, tuple[int, int, int]]] = {
    "from +x": (1, 0, 0),
    "from +y": (0, 1, 0),
    "from +z": (0, 0, 1),
    "from (1, 1, 1)": (1, 1, 1),
    "from -x": (-1, 0, 0),
    "from -y": (0, -1, 0),
    "from -z": (0, 0, -1),
    "from (-1, -1, -1)": (-1, -1, -1),
}

UP: Final = np.array([0.0, 0.0, 1.0])


def views_figure(points: Floats, triangles: Integers) -> Sheet:
    """A solid from six sides and two corners, all at one scale.

    The body's z is upward; seen from +z and -z it is y.

    points: (n, 3) in any length unit; triangles: (t, 3).
    """
    surface = Surface(points, triangles, smooth=False)
    pictures = []
    for side in SIDES.values():
        up = (0, 1, 0) if side[:2] == (0, 0) else (0, 0, 1)
        pictures.append(render(surface, camera_on(points, side, up), VIEW_PIXELS))
    return picture_grid(pictures, list(SIDES), 4)


def views(die: FinishedDie) -> Sheet:
    """A die from several sides, with its labels where it has them."""
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    return views_figure(solid.points, solid.triangles)


def color_triangles(points: Floats, triangles: Integers, colors: Floats) -> Surface:
    """A solid with flat faces whose triangles (t, 3) have colors (t, 3) of their own."""
    corners = points[triangles].reshape(-1, 3)
    flat = np.arange(len(corners)).reshape(-1, 3)
    return Surface(corners, flat, colors.repeat(3, axis=0), smooth=False)


def print_orientation_figure(
    points: Floats, triangles: Integers, hanging: Booleans, touching: Booleans
) -> Sheet:
    """A solid on the bed z = 0, from the side and from beneath.

    points: (n, 3) in any length unit, none of them below the bed; triangles: (t, 3); hanging,
    touching: (t,) those that need supports, red, and those on the bed, blue.
    """
    beside = Camera(np.array([1.0, -0.8, 0.55]), UP, np.zeros(3), 1.0)
    beneath = Camera(-UP, np.array([0.0, 1.0, 0.0]), np.zeros(3), 1.0)
    beside, beneath = framed([beside, beneath], [with_shadow(points, UP), points])
    colors = np.where(touching[:, None], (0.42, 0.60, 0.80), MATERIAL.astype(np.float64))
    colors = np.where(hanging[:, None], (0.87, 0.35, 0.22), colors)
    colored = color_triangles(points, triangles, colors)
    # From beside nothing is coloured where nothing hangs over.
    solid = colored if hanging.any() else Surface(points, triangles, smooth=False)
    pictures = [render_on_table(solid, UP, beside, PIXELS), render(colored, beneath, PIXELS)]
    return picture_grid(trim(pictures), ["on the bed", "from beneath"], 2)


def print_orientation(die: FinishedDie) -> Sheet:
    """A die as it is best printed, and what needs supports."""
    from dicedesign.fabricate.printability import ON_BED, PrintedSolid
    from dicedesign.fabricate.printers import PRINTERS

    found = die.result.printability
    assert found is not None
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    judged = die.plain if die.engraved is None else die.engraved.assessment or die.plain
    hull = judged.poses.hull if die.reshaped is None else None
    printed = PrintedSolid(solid.points, solid.triangles, hull, (), np.zeros((0, 3)))
    placement, down = np.array(found.placement), np.array([found.best.normal])
    printer = replace(PRINTERS[found.printer], layer_mm=found.layer_mm)
    points = solid.points @ placement[:3, :3].T + placement[:3, 3]
    return print_orientation_figure(
        points,
        solid.triangles,
        printed.overhanging(down, printer)[:, 0],
        points[solid.triangles][:, :, 2].max(axis=1) < ON_BED,
    )


READ_COLOR: Final = "#f2dd6e"
"""Of the facet that is read; its label has the accent colour."""


def reading_figure(
    surface: Surface,
    down: Floats,
    across: Floats,
    sides: Sequence[tuple[str, Floats, Floats]],
    sentence: str,
) -> Sheet:
    """A die as it lies on a table, then its labels straight from outside, and how it is read.

    Parameters
    ----------
    surface: the die.
    down: (3,) unit direction of the body that points to the table.
    across: (3,) direction of the body, not parallel to that, that runs away from the viewer.
    sides: for each of the other pictures a title, the direction (3,) from the body to the viewer,
        and the one (3,) that is upward, not parallel to it.
    sentence: below the pictures.
    """
    away = across - (across @ down) * down
    away /= np.linalg.norm(away)
    rise, turn = np.radians(35.0), np.radians(30.0)
    level = -np.cos(turn) * away + np.sin(turn) * np.cross(down, away)
    oblique = Camera(np.cos(rise) * level - np.sin(rise) * down, -down, np.zeros(3), 1.0)
    straight = [Camera(side, up, np.zeros(3), 1.0) for _, side, up in sides]
    seen = [with_shadow(surface.points, -down), *[surface.points] * len(sides)]
    oblique, *straight = framed([oblique, *straight], seen)
    pictures = [render_on_table(surface, -down, oblique, PIXELS)]
    pictures += [render(surface, camera, PIXELS) for camera in straight]
    titles, below = ["as it lies", *(title for title, _, _ in sides)], 44.0
    sheet = picture_grid(trim(pictures), titles, len(pictures), below=below)
    sheet.text(sentence, (sheet.width / 2.0, sheet.height - below / 2.0 - 6.0))
    return sheet


def paint_labels(
    points: Floats, triangles: Integers, labels: Sequence[tuple[LabelPlace, Placement]]
) -> Surface:
    """A solid of points (n, 3) and triangles (t, 3) with some labels and their facets in colour;
    the labels alone, where there are several around a corner, as the facets bear others too."""
    corners = points[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1)
    middles = corners.mean(axis=1)
    colors = np.tile(np.asarray(MATERIAL, dtype=np.float64), (len(triangles), 1))
    facet_color, label_color = rgb([READ_COLOR, ACCENT])
    extent = float(np.ptp(points, axis=0).max())
    # Triangles are of a facet within 1e-4 of the extent of its plane and 2.6 degrees of its normal;
    # the finished shape is up to 0.02 of the extent off the one that was laid out.
    thin, parallel, slack = 1e-4 * extent, 0.999, 0.02 * extent
    is_shared = len({place.facet for place, _ in labels}) >= 3
    for place, placement in labels:
        outward = placement.frame[:3, 2]
        here = areas @ outward > parallel * sizes
        here &= _beneath(middles, place, slack)
        level = np.rint((middles - placement.frame[:3, 3]) @ outward / thin).astype(np.int64)
        flush = here & (np.abs(level) <= 1)
        if not is_shared:
            colors[flush] = facet_color
        # The floor of all pockets is on one level; triangles on others are of other facets' labels.
        off = np.flatnonzero(here & (np.abs(level) > 1))
        if not len(off):
            continue
        levels, which = np.unique(level[off], return_inverse=True)
        floor = off[np.abs(level[off] - levels[np.bincount(which, sizes[off]).argmax()]) <= 1]
        inside = _beneath(corners.reshape(-1, 3), place, slack)
        within = np.logical_and.reduce(inside.reshape(-1, 3), axis=1)
        # A floor that goes on beyond a label's part is a field that labels stand in.
        colors[floor if within[floor].all() else flush & within] = label_color
    return color_triangles(points, triangles, colors)


def _beneath(points: Floats, place: LabelPlace, slack: float) -> Booleans:
    """(n,) whether points lie above or below a region, or beside it by no more than a slack."""
    inside = np.ones(len(points), dtype=bool)
    for start, end in zip(place.region, np.roll(place.region, -1, axis=0), strict=True):
        inward = np.cross(place.normal, end - start)
        inside &= (points - start) @ inward >= -slack * np.linalg.norm(inward)
    return inside


def reading(die: FinishedDie) -> Sheet:
    """A die at rest, and the label that is read then."""
    assert die.engraved is not None
    assert die.reading is not None
    result, way = die.result, die.reading.way
    outcome = int(np.argmax(result.target))
    label, down = result.labels[outcome], die.plain.poses.normals[die.plain.outcomes.main[outcome]]
    mine = [
        (place, placement)
        for place, placement in zip(die.reading.places, die.engraved.placements, strict=True)
        if place.outcome == outcome
    ]
    if mine:
        surface = paint_labels(die.engraved.points, die.engraved.triangles, mine)
        ups = [placement.frame[:3, 1] for _, placement in mine]
    else:
        surface = Surface(die.engraved.points, die.engraved.triangles)
        ups = [np.eye(3)[np.argmin(np.abs(down))]]
    # Of two labels the one on top comes last.
    above = (f"from above: {label}", -down, ups[-1])
    below = (f"lifted, from below: {label}", down, ups[0])
    sides = {"down": [below], "both": [above, below]}.get(way, [above])
    if way == "corner":
        sides = [(f"one side: {label}", mine[-1][0].normal, ups[-1])]
    return reading_figure(surface, down, ups[-1], sides, die.reading.sentence)


CELL: Final = 210.0
"""Pixels of the widest or tallest face."""

FACE_COLUMNS: Final = 6

MOST_FACES: Final = 60
"""Faces up to which those without a label are drawn too."""

FACE_COLOR: Final = "#e6eaee"

BARS_MM: Final = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Lengths of a scale bar; the longest that is not longer than a face is taken."""


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
        frame, cuts = own[0].frame, []
        for placement in own:
            for contour in placement.section().to_polygons():
                lifted = placement.frame[:3, 3] + np.asarray(contour) @ placement.frame[:3, :2].T
                cuts.append(_flat(frame, lifted))
        outline = _flat(frame, hull.polygon(facet))
        faces.append(Face(outline, tuple(cuts), titles.get(facet, "")))
    if len(on_facet) + len(blank) <= MOST_FACES:
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
    return np.asarray((points - frame[:3, 3]) @ frame[:3, :2])


@styled
def faces_figure(faces: Sequence[Face]) -> Sheet:
    """Faces side by side, all on one scale, and a bar of so many millimetres.

    Raises InputError: there is no face.
    """
    if not faces:
        raise InputError("faces: expected at least one, got none; pass those of a die")
    gap, title_room = 26.0, 34.0
    extents = np.array([np.ptp(face.outline, axis=0) for face in faces])
    scale = CELL / float(extents.max())
    columns = min(FACE_COLUMNS, len(faces))
    rows = [range(k, min(k + columns, len(faces))) for k in range(0, len(faces), columns)]
    heights = [scale * float(extents[list(row), 1].max()) for row in rows]
    tall = sum(heights) + len(rows) * (title_room + gap) + 3.0 * gap
    sheet = Sheet(columns * (CELL + gap) + gap, tall)
    top = gap
    for row, height in zip(rows, heights, strict=True):
        for column, number in enumerate(row):
            middle = gap + column * (CELL + gap) + 0.5 * CELL
            face = faces[number]
            if face.title:
                place = (middle, top + title_room - 8.0)
                sheet.text(face.title, place, size=NOTE, anchor="md")
            _draw_face(sheet, face, scale, (middle, top + title_room + 0.5 * height))
        top += title_room + height + gap
    length = max((bar for bar in BARS_MM if bar * scale <= CELL), default=BARS_MM[0])
    y, end = top + 0.5 * gap, gap + scale * length
    sheet.drawing.plot([gap, end], [y, y], "|-", color=DARK, lw=2.0, ms=10.0, mew=2.0)
    sheet.text(f"{length:g} mm", (end + 10.0, y), size=NOTE, anchor="lm")
    return sheet


def _draw_face(sheet: Sheet, face: Face, scale: float, middle: tuple[float, float]) -> None:
    center = 0.5 * (face.outline.min(axis=0) + face.outline.max(axis=0))

    def on_sheet(points: Floats) -> Floats:
        return np.asarray(np.array(middle) + scale * (points - center) * (1.0, -1.0))

    outline = Polygon(on_sheet(face.outline), facecolor=FACE_COLOR, edgecolor=FAINT, linewidth=1.5)
    sheet.drawing.add_patch(outline)
    if face.cuts:
        closed = [np.vstack([contour, contour[:1]]) for contour in face.cuts]
        path = Path.make_compound_path(*(Path(on_sheet(c), closed=True) for c in closed))
        sheet.drawing.add_patch(PathPatch(path, facecolor=DARK, linewidth=0.0))


def faces(die: FinishedDie) -> Sheet:
    """Every face of a die: above those with one label what it says and how often that comes up, and
    above those that count for nothing how often the die rests there."""
    assert die.engraved is not None
    result, placements = die.result, die.engraved.placements
    hull = die.engraved.core or die.plain.poses.hull
    titles = {}
    for facet in result.facets:
        if facet.outcome is None:
            flat = int(np.argmax(hull.normals @ np.array(facet.normal)))
            titles[flat] = f"other: {_percent(facet.probability)}"
    shares = result.probabilities
    if result.thrown is not None:
        simulated = result.thrown.simulated
        shares = result.thrown.momentum if simulated is None else simulated.frequencies
    by_label = dict(zip(result.labels, shares, strict=True))
    facets = [_facet_of(hull, placement.frame) for placement in placements]
    labels_on = Counter(facets)
    for flat, placement in zip(facets, placements, strict=True):
        if labels_on[flat] == 1:
            titles[flat] = f"{placement.text}: {_percent(by_label[placement.text])}"
    return faces_figure(faces_of(hull, placements, titles))


def _percent(share: float) -> str:
    digits = 1 if share <= 0.0 else max(0, min(3, 1 - math.floor(math.log10(100.0 * share))))
    return f"{100.0 * share:.{digits}f} %"
