"""Figures of dice with flat faces: views, faces, how the die is read and printed."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.palette import BLANK, DARK, INK, outcome_colors, rgb, text_color
from dicedesign.report.paper import COLUMN_WIDTH, GAP, POINTS
from dicedesign.report.raster import UP, Camera, frame_cameras, tilt_up
from dicedesign.report.renderer import (
    MATERIAL,
    RenderMesh,
    color_triangles,
    render,
    render_on_table,
    with_shadow,
)
from dicedesign.report.sheet import (
    BODY,
    LINE,
    NOTE,
    Sheet,
    cell_pixels,
    fold,
    grid_columns,
    picture_grid,
    with_style,
)
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.fabricate.label_layout import Placement

VIEW_COLUMNS = 4
"""Most views in a row."""

CANDIDATE_COLUMNS = 3
"""Most dice in a row."""

MIN_COLUMNS = 3
"""Fewest columns, so that two pictures are no larger than three."""

SIDES: dict[str, tuple[int, int, int]] = {
    "from +x": (1, 0, 0),
    "from +y": (0, 1, 0),
    "from +z": (0, 0, 1),
    "from (1, 1, 1)": (1, 1, 1),
    "from -x": (-1, 0, 0),
    "from -y": (0, -1, 0),
    "from -z": (0, 0, -1),
    "from (-1, -1, -1)": (-1, -1, -1),
}
"""Directions to the camera."""

FACE_COLUMNS = 6
"""Faces in a row, of up to 18; rows of more faces are longer."""

MAX_FACES = 60
"""Most faces of a die for which those without a label are drawn too."""

BARS_MM = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Lengths of a scale bar; the longest one that is not longer than a face is drawn."""


def views(points: Floats, triangles: Integers, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Solid from six sides and two corners, all at one scale.

    The body's z points upward; in the views from +z and -z, y does.

    points: (n, 3); triangles: (t, 3); width: in inches.
    """
    surface = RenderMesh(points, triangles, smooth=False)
    cameras = [
        Camera(np.array(side, float), np.eye(3)[1 if side[:2] == (0, 0) else 2])
        for side in SIDES.values()
    ]
    cameras = frame_cameras(cameras, [surface.points] * len(cameras))
    columns = grid_columns(width, VIEW_COLUMNS)
    size = cell_pixels(width, columns)
    pictures = [render(surface, camera, size) for camera in cameras]
    return picture_grid(pictures, list(SIDES), columns, width)


def candidates(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Dice that were compared, each at its size, from one side. width: in inches."""
    compared, pictures = die.result.candidates, []
    columns = grid_columns(width, CANDIDATE_COLUMNS)
    size = cell_pixels(width, columns)
    largest = max(one.size_mm for one in compared)
    camera = Camera(np.array([1.0, -0.8, 0.55]), UP)
    for hull, one in zip(die.candidates, compared, strict=True):
        points = (hull.vertices - hull.centroid) / hull.diameter
        frame = points * largest / one.size_mm
        mesh = RenderMesh(points, hull.triangles, smooth=False)
        pictures.append(render(mesh, frame_cameras([camera], [frame])[0], size))
    names = [f"{number}: {one.name}" for number, one in enumerate(compared, start=1)]
    return picture_grid(pictures, names, columns, width)


def print_orientation(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Die in its best print orientation, from the side and from beneath: parts that touch the print
    bed are blue, and parts that need supports are red. width: in inches."""
    from dicedesign.fabricate.printability import ON_BED, PrintedSolid
    from dicedesign.fabricate.printers import PRINTERS

    print_facts = die.result.printability
    assert print_facts is not None
    points, triangles = die.printed.points, die.printed.triangles
    hull = die.final.poses.hull if die.reshaped is None else None
    solid = PrintedSolid(points, triangles, hull, (), np.zeros((0, 3)))
    printer = replace(PRINTERS[print_facts.printer], layer_mm=print_facts.layer_mm)
    hanging = solid.overhanging(np.array([print_facts.best.normal]), printer)[:, 0]
    placement = np.array(print_facts.placement)
    placed = points @ placement[:3, :3].T + placement[:3, 3]
    touching = placed[triangles][:, :, 2].max(axis=1) < ON_BED
    colors = np.where(touching[:, None], (0.42, 0.60, 0.80), MATERIAL)
    colors = np.where(hanging[:, None], (0.87, 0.35, 0.22), colors)
    colored = color_triangles(placed, triangles, colors)
    # From the side no color is needed if nothing hangs over.
    beside = colored if hanging.any() else RenderMesh(placed, triangles, smooth=False)
    cameras = [Camera(np.array([1.0, -0.8, 0.55]), UP), Camera(-UP, np.array([0.0, 1.0, 0.0]))]
    above, beneath = frame_cameras(cameras, [with_shadow(placed, UP), placed])
    size = cell_pixels(width, MIN_COLUMNS)
    pictures = [render_on_table(beside, UP, above, size), render(colored, beneath, size)]
    return picture_grid(pictures, ["on the bed", "from beneath"], MIN_COLUMNS, width)


def paint_labels(solid: Surface, labels: Sequence[Placement], color: str) -> RenderMesh:
    """Solid with the facets of labels in a color, and the labels in a color to be read on it.

    Three or more labels around a corner are colored alone, as their facets bear others too.
    """
    points, triangles = solid.points, solid.triangles
    areas, middles = doubled_area_vectors(points, triangles), points[triangles].mean(axis=1)
    colors = np.tile(MATERIAL, (len(triangles), 1))
    facet_color, label_color = rgb([color, text_color(color) if len(labels) < 3 else INK])
    flush = 1e-4 * float(np.ptp(points, axis=0).max())
    for placement in labels:
        # Within 2.6 degrees triangles count as parallel to the facet.
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


def reading(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """Die at rest on a table, and the label to read, seen straight from outside.

    The outcome is the most probable one of the target that is not blank; its facet has its color.
    width: in inches.
    """
    assert die.engraved is not None
    assert die.reading is not None
    target, way = die.plain.target, die.reading.way
    shown = sorted({place.outcome for place in die.reading.places}) or range(
        len(target.face_labels)
    )
    face = max(shown, key=lambda one: float(target.probabilities[target.outcome_of_face[one]]))
    label, down = target.face_labels[face], die.plain.poses.normals[die.plain.outcomes.main[face]]
    pairs = zip(die.reading.places, die.engraved.placements, strict=True)
    labels = [placement for place, placement in pairs if place.outcome == face]
    if labels:
        color = outcome_colors(len(target.labels))[target.outcome_of_face[face]]
        surface = paint_labels(die.engraved, labels, color)
        ups = [placement.frame[:3, 1] for placement in labels]
    else:
        surface = RenderMesh(die.engraved.points, die.engraved.triangles)
        ups = [np.eye(3)[np.argmin(np.abs(down))]]
    # Of two labels the one on top comes last.
    above = (f"from above: {label}", Camera(-down, ups[-1]))
    below = (f"lifted, from below: {label}", Camera(down, ups[0]))
    sides = {"down": [below], "both": [above, below]}.get(way, [above])
    if way == "corner":
        sides = [(f"one side: {label}", Camera(labels[-1].frame[:3, 2], ups[-1]))]
    # The upper side of the label points away from the viewer, a little aside.
    away = unit_vectors(ups[-1] - (ups[-1] @ down) * down)
    turn = np.radians(30.0)
    level = -np.cos(turn) * away + np.sin(turn) * np.cross(down, away)
    cameras = [Camera(tilt_up(level, -down, 35.0), -down), *(camera for _, camera in sides)]
    points = surface.points
    oblique, *straight = frame_cameras(
        cameras, [with_shadow(points, -down), *[points] * len(sides)]
    )
    columns = max(MIN_COLUMNS, 1 + len(straight))
    size = cell_pixels(width, columns)
    pictures = [render_on_table(surface, -down, oblique, size)]
    pictures += [render(surface, camera, size) for camera in straight]
    titles = ["at rest", *(title for title, _ in sides)]
    sentence = fold(die.reading.sentence, POINTS * width - 2.0 * GAP, BODY)
    room = LINE * BODY * (sentence.count("\n") + 1) + GAP
    sheet = picture_grid(pictures, titles, columns, width, below=room)
    sheet.write(sentence, (sheet.width / 2.0, sheet.height - room), va="top")
    return sheet


@with_style
def faces(die: FinishedDie, *, width: float = COLUMN_WIDTH) -> Sheet:
    """All faces of a die side by side at one scale in the colors of their outcomes, with their
    labels, and a scale bar in millimeters.

    Faces with labels come first, in the order of the labels. Titles are a label with its
    probability, for one label on a face, or the probability of a rest that counts for no outcome.
    Faces with several labels or none have the color of no outcome. width: in inches.
    """
    assert die.engraved is not None
    result, hull = die.result, die.engraved.core or die.plain.poses.hull
    labels: dict[int, list[Placement]] = defaultdict(list)
    for placement in die.engraved.placements:
        # The facet whose plane is nearest.
        normal, origin = placement.frame[:3, 2:].T
        distances = np.abs(hull.heights(origin)) / hull.diameter
        labels[int(np.argmax(hull.normals @ normal - distances))].append(placement)
    shares = result.probabilities
    if result.thrown is not None:
        simulated = result.thrown.simulated
        shares = result.thrown.momentum if simulated is None else simulated.frequencies
    by_label = dict(zip(result.labels, shares, strict=True))
    titles = {
        int(np.argmax(hull.normals @ facet.normal)): f"other: {_percent(facet.probability)}"
        for facet in result.facets
        if facet.outcome is None
    }
    color_of = dict(zip(result.labels, outcome_colors(len(result.labels)), strict=True))
    colors: dict[int, str] = {}
    for facet, placements in labels.items():
        if len(placements) == 1:
            text = placements[0].text
            titles[facet] = f"{text}: {_percent(by_label[text])}"
            colors[facet] = color_of[text]
    others = range(len(hull.normals) if len(hull.normals) <= MAX_FACES else 0)
    facets = list(dict.fromkeys([*labels, *others]))
    contours = [
        list(_flat_contours(hull.polygon(facet), hull.normals[facet], labels[facet]))
        for facet in facets
    ]
    extents = np.array([np.ptp(outline, axis=0) for outline, *_ in contours])
    most = max(FACE_COLUMNS, math.ceil(1.4 * math.sqrt(len(facets))))
    columns = grid_columns(width, min(most, max(len(facets), 2)))
    # Of the largest face; others have its scale.
    side = (POINTS * width - GAP) / columns - GAP
    scale, title_room = side / float(extents.max()), LINE * NOTE + 3.0
    heights = scale * np.maximum.reduceat(extents[:, 1], np.arange(0, len(facets), columns))
    bottoms = np.cumsum(heights + title_room + GAP)
    sheet = Sheet(POINTS * width, bottoms[-1] + 3.0 * GAP)
    for number, (facet, (outline, *cuts)) in enumerate(zip(facets, contours, strict=True)):
        row, column = divmod(number, columns)
        x = GAP + column * (side + GAP) + side / 2.0
        middle = np.array([x, bottoms[row] - heights[row] / 2.0])
        above = (x, bottoms[row] - heights[row] - 3.0)
        sheet.write(fold(titles.get(facet, ""), side, NOTE), above, size=NOTE, va="bottom")
        center = (outline.min(axis=0) + outline.max(axis=0)) / 2.0
        ground = colors.get(facet, BLANK)
        for rings, color, line in (([outline], ground, 0.5), (cuts, text_color(ground), 0.0)):
            placed = [middle + scale * (ring - center) * (1.0, -1.0) for ring in rings]
            closed = [Path(np.vstack([ring, ring[:1]]), closed=True) for ring in placed]
            path = Path.make_compound_path(*closed)
            patch = PathPatch(path, facecolor=color, edgecolor=DARK, linewidth=line)
            sheet.drawing.add_patch(patch)
    length = max((bar for bar in BARS_MM if bar * scale <= side), default=BARS_MM[0])
    y, end = sheet.height - 1.5 * GAP, GAP + scale * length
    sheet.drawing.plot([GAP, end], [y, y], "|-", color=DARK, lw=0.8, ms=4.0, mew=0.8)
    sheet.write(f"{length:g} mm", (end + 4.0, y), size=NOTE, ha="left")
    return sheet


def _flat_contours(
    polygon: Floats, normal: Floats, placements: Sequence[Placement]
) -> Iterator[Floats]:
    """Yield the outline (m, 2) of a facet, seen from outside, and the contours of its labels.

    Labels are upright; without any, the longest edge runs to the right.
    """
    if placements:
        flat = placements[0].frame[:3, :2]
    else:
        edges = np.roll(polygon, -1, axis=0) - polygon
        right = unit_vectors(edges[norms(edges).argmax()])
        flat = np.column_stack([right, np.cross(normal, right)])
    yield polygon @ flat
    for placement in placements:
        for contour in placement.section().to_polygons():
            yield (placement.frame[:3, 3] + np.asarray(contour) @ placement.frame[:3, :2].T) @ flat


def _percent(share: float) -> str:
    """Percentage of two digits."""
    digits = 1 if share <= 0.0 else max(0, min(3, 1 - math.floor(math.log10(100.0 * share))))
    return f"{100.0 * share:.{digits}f} %"
