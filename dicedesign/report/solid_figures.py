"""Figures of dice with flat faces: views, faces, how the die is read, how it is best printed, and
dice of the paper's ablation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between, norms, unit_vectors
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.report.palette import ACCENT, BASINS, DARK, FAINT, rgb
from dicedesign.report.raster import UP, Camera, camera_on, frame_cameras, tilt_up
from dicedesign.report.renderer import (
    MATERIAL,
    RenderMesh,
    color_triangles,
    render,
    render_on_table,
    with_shadow,
)
from dicedesign.report.sheet import NOTE, Sheet, picture_grid, with_style
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Booleans, Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.fabricate.label_layout import Placement

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

READ_COLOR: Final = "#f2dd6e"
"""Of the facet that is read; its label has the accent color."""

CELL: Final = 210.0
"""Pixels of the widest or tallest face."""

FACE_COLUMNS: Final = 6

MOST_FACES: Final = 60
"""Faces up to which those without a label are drawn too."""

BARS_MM: Final = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Lengths of a scale bar; the longest that is not longer than a face is taken."""


def views_figure(points: Floats, triangles: Integers) -> Sheet:
    """A solid from six sides and two corners, all at one scale.

    The body's z is upward; seen from +z and -z it is y.

    points: (n, 3) in any length unit; triangles: (t, 3).
    """
    surface = RenderMesh(points, triangles, smooth=False)
    ups = [(0, 1, 0) if side[:2] == (0, 0) else (0, 0, 1) for side in SIDES.values()]
    cameras = [camera_on(points, *pair) for pair in zip(SIDES.values(), ups, strict=True)]
    pictures = [render(surface, camera, VIEW_PIXELS) for camera in cameras]
    return picture_grid(pictures, list(SIDES), 4)


def views(die: FinishedDie) -> Sheet:
    """A die from several sides, with its labels where it has them."""
    return views_figure(*mesh_to_print(die))


def mesh_to_print(die: FinishedDie) -> tuple[Floats, Integers]:
    """Points (n, 3) and triangles (t, 3) of a die, with its labels where it has them."""
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    return solid.points, solid.triangles


def print_orientation_figure(
    points: Floats, triangles: Integers, hanging: Booleans, touching: Booleans
) -> Sheet:
    """A solid on the bed z = 0, from the side and from beneath.

    points: (n, 3) in any length unit, none of them below the bed; triangles: (t, 3); hanging,
    touching: (t,) those that need supports, red, and those on the bed, blue.
    """
    beside = Camera(np.array([1.0, -0.8, 0.55]), UP)
    beneath = Camera(-UP, np.array([0.0, 1.0, 0.0]))
    beside, beneath = frame_cameras([beside, beneath], [with_shadow(points, UP), points])
    colors = np.where(touching[:, None], (0.42, 0.60, 0.80), MATERIAL)
    colors = np.where(hanging[:, None], (0.87, 0.35, 0.22), colors)
    colored = color_triangles(points, triangles, colors)
    # From beside nothing is colored where nothing hangs over.
    solid = colored if hanging.any() else RenderMesh(points, triangles, smooth=False)
    pictures = [render_on_table(solid, UP, beside, PIXELS), render(colored, beneath, PIXELS)]
    return picture_grid(pictures, ["on the bed", "from beneath"], 2)


def print_orientation(die: FinishedDie) -> Sheet:
    """A die in its best print orientation, and what needs supports."""
    from dicedesign.fabricate.printability import ON_BED, PrintedSolid
    from dicedesign.fabricate.printers import PRINTERS

    print_facts = die.result.printability
    assert print_facts is not None
    points, triangles = mesh_to_print(die)
    judged = die.plain if die.engraved is None else die.engraved.assessment or die.plain
    hull = judged.poses.hull if die.reshaped is None else None
    printed = PrintedSolid(points, triangles, hull, (), np.zeros((0, 3)))
    placement, down = np.array(print_facts.placement), np.array([print_facts.best.normal])
    printer = replace(PRINTERS[print_facts.printer], layer_mm=print_facts.layer_mm)
    placed = points @ placement[:3, :3].T + placement[:3, 3]
    touching = placed[triangles][:, :, 2].max(axis=1) < ON_BED
    hanging = printed.overhanging(down, printer)[:, 0]
    return print_orientation_figure(placed, triangles, hanging, touching)


def reading_figure(
    surface: RenderMesh,
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
    away = unit_vectors(across - (across @ down) * down)
    turn = np.radians(30.0)
    level = -np.cos(turn) * away + np.sin(turn) * np.cross(down, away)
    cameras = [Camera(tilt_up(level, -down, 35.0), -down)]
    cameras += [Camera(side, up) for _, side, up in sides]
    visible_points = [with_shadow(surface.points, -down), *[surface.points] * len(sides)]
    oblique, *straight = frame_cameras(cameras, visible_points)
    pictures = [render_on_table(surface, -down, oblique, PIXELS)]
    pictures += [render(surface, camera, PIXELS) for camera in straight]
    titles = ["as it lies", *(title for title, _, _ in sides)]
    sheet = picture_grid(pictures, titles, len(pictures), below=44.0)
    sheet.text(sentence, (sheet.width / 2.0, sheet.height - 28.0))
    return sheet


def paint_labels(points: Floats, triangles: Integers, labels: Sequence[Placement]) -> RenderMesh:
    """A solid of points (n, 3) and triangles (t, 3) with some labels and their facets in color;
    the labels alone, where there are several around a corner, as the facets bear others too."""
    areas, middles = doubled_area_vectors(points, triangles), points[triangles].mean(axis=1)
    colors = np.tile(MATERIAL, (len(triangles), 1))
    facet_color, label_color = rgb([READ_COLOR, ACCENT])
    flush = 1e-4 * float(np.ptp(points, axis=0).max())
    for placement in labels:
        # Triangles are parallel to a facet within 2.6 degrees.
        parallel = areas @ placement.frame[:3, 2] > 0.999 * norms(areas)
        flat = (middles - placement.frame[:3, 3]) @ placement.frame[:3, :3]
        if len(labels) < 3:
            colors[parallel & (np.abs(flat[:, 2]) <= flush)] = facet_color
        # Holes are outlines within others.
        within = np.zeros(len(triangles), dtype=bool)
        for outline in placement.section().to_polygons():
            within ^= Path(outline).contains_points(flat[:, :2])
        colors[parallel & within] = label_color
    return color_triangles(points, triangles, colors)


def reading(die: FinishedDie) -> Sheet:
    """A die at rest, and the label that is read then."""
    assert die.engraved is not None
    assert die.reading is not None
    result, way = die.result, die.reading.way
    outcome = int(np.argmax(result.target))
    label, down = result.labels[outcome], die.plain.poses.normals[die.plain.outcomes.main[outcome]]
    places = zip(die.reading.places, die.engraved.placements, strict=True)
    mine = [placement for place, placement in places if place.outcome == outcome]
    if mine:
        surface = paint_labels(die.engraved.points, die.engraved.triangles, mine)
        ups = [placement.frame[:3, 1] for placement in mine]
    else:
        surface = RenderMesh(die.engraved.points, die.engraved.triangles)
        ups = [np.eye(3)[np.argmin(np.abs(down))]]
    # Of two labels the one on top comes last.
    above = (f"from above: {label}", -down, ups[-1])
    below = (f"lifted, from below: {label}", down, ups[0])
    sides = {"down": [below], "both": [above, below]}.get(way, [above])
    if way == "corner":
        sides = [(f"one side: {label}", mine[-1].frame[:3, 2], ups[-1])]
    return reading_figure(surface, down, ups[-1], sides, die.reading.sentence)


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
        on_facet.setdefault(_facet_of(hull, placement), []).append(placement)
    facets = range(len(hull.normals) if len(hull.normals) <= MOST_FACES else 0)
    faces = []
    for facet in dict.fromkeys([*on_facet, *facets]):
        own, polygon = on_facet.get(facet, []), hull.polygon(facet)
        if own:
            flat = own[0].frame[:3, :2]
        else:
            # With its longest edge to the right.
            edges = np.roll(polygon, -1, axis=0) - polygon
            right = unit_vectors(edges[norms(edges).argmax()])
            flat = np.column_stack([right, np.cross(hull.normals[facet], right)])
        cuts = [
            (placement.frame[:3, 3] + np.asarray(contour) @ placement.frame[:3, :2].T) @ flat
            for placement in own
            for contour in placement.section().to_polygons()
        ]
        faces.append(Face(polygon @ flat, tuple(cuts), titles.get(facet, "")))
    return faces


def _facet_of(hull: ConvexHull, placement: Placement) -> int:
    """The facet in whose plane a label lies, as nearly as any."""
    normal, place = placement.frame[:3, 2:].T
    return int(np.argmax(hull.normals @ normal - np.abs(hull.heights(place)) / hull.diameter))


@with_style
def faces_figure(faces: Sequence[Face]) -> Sheet:
    """Faces side by side at one scale, with a scale bar in millimeters.

    Raises InputError: there is no face.
    """
    if not faces:
        raise InputError("faces: expected at least one, got none; pass those of a die")
    gap, title_room = 26.0, 34.0
    extents = np.array([np.ptp(face.outline, axis=0) for face in faces])
    scale = CELL / float(extents.max())
    columns = min(FACE_COLUMNS, len(faces))
    rows = [slice(k, k + columns) for k in range(0, len(faces), columns)]
    heights = [scale * float(extents[row, 1].max()) for row in rows]
    tall = sum(heights) + len(rows) * (title_room + gap) + 3.0 * gap
    sheet = Sheet(columns * (CELL + gap) + gap, tall)
    top = gap + title_room
    for row, height in zip(rows, heights, strict=True):
        for column, face in enumerate(faces[row]):
            middle = np.array([gap + column * (CELL + gap) + CELL / 2.0, top + height / 2.0])
            sheet.text(face.title, (middle[0], top - 8.0), size=NOTE, va="bottom")
            center = (face.outline.min(axis=0) + face.outline.max(axis=0)) / 2.0
            for contours, face_color in (([face.outline], "#e6eaee"), (face.cuts, DARK)):
                closed = [np.vstack([contour, contour[:1]]) for contour in contours]
                placed = [middle + scale * (ring - center) * (1.0, -1.0) for ring in closed]
                path = Path.make_compound_path(*(Path(ring, closed=True) for ring in placed))
                edge = {"edgecolor": FAINT, "linewidth": 1.5 if face_color != DARK else 0.0}
                sheet.drawing.add_patch(PathPatch(path, facecolor=face_color, **edge))
        top += title_room + height + gap
    length = max((bar for bar in BARS_MM if bar * scale <= CELL), default=BARS_MM[0])
    y, end = top - title_room + 0.5 * gap, gap + scale * length
    sheet.drawing.plot([gap, end], [y, y], "|-", color=DARK, lw=2.0, ms=10.0, mew=2.0)
    sheet.text(f"{length:g} mm", (end + 10.0, y), size=NOTE, ha="left")
    return sheet


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
    facets = [_facet_of(hull, placement) for placement in placements]
    for flat, placement in zip(facets, placements, strict=True):
        if facets.count(flat) == 1:
            titles[flat] = f"{placement.text}: {_percent(by_label[placement.text])}"
    return faces_figure(faces_of(hull, placements, titles))


def _percent(share: float) -> str:
    digits = 1 if share <= 0.0 else max(0, min(3, 1 - math.floor(math.log10(100.0 * share))))
    return f"{100.0 * share:.{digits}f} %"


@dataclass(frozen=True, eq=False)
class Ablation:
    """A die that was designed without some terms of the energy.

    Attributes
    ----------
    name: what was left out.
    error: largest |p - q| of the outcomes.
    poses: its rests; outcomes: (k,) which outcome each counts for.
    """

    name: str
    error: float
    poses: RestPoses
    outcomes: Integers


def ablation_figure(ablations: Sequence[Ablation]) -> Sheet:
    """Dice, each from two sides, with what was left out in their design, how far their
    probabilities are off, and how far rests are from the most probable one of their outcome.
    Source: figure 9 of the paper."""
    side, gap, title_room = 360, 24.0, 64.0
    wide, tall = 2.0 * side + gap, side + title_room + gap
    sheet = Sheet(2.0 * wide + gap, -(-len(ablations) // 2) * tall + 40.0)
    for number, ablation in enumerate(ablations):
        poses, hull, outcomes = ablation.poses, ablation.poses.hull, ablation.outcomes
        left, top = gap + number % 2 * wide, gap + number // 2 * tall
        # The most probable rest of the outcome of each rest; these come the most probable first.
        _, first, which = np.unique(outcomes, return_index=True, return_inverse=True)
        main = first[which]
        colors = np.tile(MATERIAL, (len(hull.normals), 1))
        colors[poses.facets] = rgb([ACCENT])
        colors[poses.facets[main]] = 0.35 + 0.65 * rgb(BASINS)[outcomes[main] % len(BASINS)]
        of_triangle = np.repeat(np.arange(len(hull.normals)), np.diff(hull.facet_start) - 2)
        surface = color_triangles(hull.vertices, hull.triangles, colors[of_triangle])
        for k, direction in enumerate(([1.0, -0.7, 0.5], [-1.0, 0.7, -0.5])):
            picture = render(surface, camera_on(surface.points, direction, UP), side)
            sheet.picture(picture, left + k * side, top + title_room)
        one, other = np.triu_indices(len(first), 1)
        normals = poses.normals
        apart = angle_between(normals[first[one]], normals[first[other]]).min(initial=np.pi)
        stray = np.degrees(angle_between(normals, normals[main]).max())
        caption = (
            f"|p − q| up to {ablation.error:.1e}, outcomes {np.degrees(apart):.0f}° apart, "
            f"{len(normals)} rests for {len(first)} of them"
        )
        caption += f", up to {stray:.1f}° off" if len(normals) > len(first) else ""
        sheet.text(ablation.name, (left + side, top + 12.0))
        sheet.text(caption, (left + side, top + 42.0), size=NOTE)
    note = (
        "Each die from two opposite sides. In pale colors the facets of the outcomes, in a strong "
        "one further rests that count for one of them."
    )
    sheet.text(note, (sheet.width / 2.0, sheet.height - 22.0), size=NOTE)
    return sheet
