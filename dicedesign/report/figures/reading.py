"""The die at rest, and the label that is read then."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.charts.palette import ACCENT, rgb
from dicedesign.report.charts.paper import BODY, Paper
from dicedesign.report.charts.picture_grid import picture_grid, trimmed
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.cameras import framed
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.report.render.shading import MATERIAL
from dicedesign.report.render.shadow import shadowed_table
from dicedesign.runtime.arrays import Booleans, Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.fabricate.label_reading import LabelPlace

__all__ = ["painted", "reading_figure"]

_PIXELS: Final = 400

_RISE: Final = 35.0

_TURN: Final = 30.0

_READ: Final = "#f2dd6e"
"""Of the facet that is read; its label has the accent colour."""

_PLANE_TOLERANCE: Final = 1e-4
"""Distance from a facet's plane up to which a triangle is of the facet, over the die's extent."""

_PARALLEL: Final = 0.999
"""Cosine of the angle to a facet's normal from which on a triangle is of the facet or a label."""

_SLACK: Final = 0.02
"""Over the die's extent."""

_SEVERAL: Final = 3
"""Facets from which on their labels alone are in colour."""

_BELOW: Final = 44.0


def reading_figure(
    surface: Surface,
    down: Floats,
    across: Floats,
    sides: Sequence[tuple[str, Floats, Floats]],
    sentence: str,
) -> Paper:
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
    rise, turn = np.radians(_RISE), np.radians(_TURN)
    level = -np.cos(turn) * away + np.sin(turn) * np.cross(down, away)
    oblique = Camera(np.cos(rise) * level - np.sin(rise) * down, -down, np.zeros(3), 1.0)
    straight = [Camera(side, up, np.zeros(3), 1.0) for _, side, up in sides]
    heights = surface.points @ -down
    heights -= heights.min()
    shadow = surface.points + heights[:, None] * down
    seen = [np.concatenate([surface.points, shadow]), *[surface.points] * len(sides)]
    cameras = framed([oblique, *straight], seen)
    table = shadowed_table(
        surface.points,
        surface.triangles,
        heights,
        -down,
        cameras[0],
        _PIXELS,
        cameras[0].half_width,
    )
    pictures = [render(surface, cameras[0], _PIXELS, backdrop=table)]
    pictures += [render(surface, camera, _PIXELS) for camera in cameras[1:]]
    titles = ["as it lies", *(title for title, _, _ in sides)]
    paper = picture_grid(trimmed(pictures), titles, len(pictures), below=_BELOW)
    middle = (paper.width / 2.0, paper.height - _BELOW / 2.0 - 6.0)
    paper.text(sentence, middle, size=BODY, anchor="mm")
    return paper


def painted(
    points: Floats, triangles: Integers, labels: Sequence[tuple[LabelPlace, Placement]]
) -> Surface:
    """A solid of points (n, 3) and triangles (t, 3) with some labels and their facets in colour;
    the labels alone, where there are several around a corner, as the facets bear others too."""
    corners = points[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(areas, axis=1)
    middles = corners.mean(axis=1)
    colors = np.tile(np.asarray(MATERIAL, dtype=np.float64), (len(triangles), 1))
    facet_color, label_color = rgb([_READ, ACCENT])
    extent = float(np.ptp(points, axis=0).max())
    thin = _PLANE_TOLERANCE * extent
    shared = len({place.facet for place, _ in labels}) >= _SEVERAL
    for place, placement in labels:
        outward = placement.frame[:3, 2]
        here = areas @ outward > _PARALLEL * sizes
        here &= _beneath(middles, place, _SLACK * extent)
        level = np.rint((middles - placement.frame[:3, 3]) @ outward / thin).astype(np.int64)
        flush = here & (np.abs(level) <= 1)
        if not shared:
            colors[flush] = facet_color
        # The floor of all pockets is on one level; triangles on others are of other facets' labels.
        off = np.flatnonzero(here & (np.abs(level) > 1))
        if not len(off):
            continue
        levels, which = np.unique(level[off], return_inverse=True)
        floor = off[np.abs(level[off] - levels[np.bincount(which, sizes[off]).argmax()]) <= 1]
        inside = _beneath(corners.reshape(-1, 3), place, _SLACK * extent)
        within = np.logical_and.reduce(inside.reshape(-1, 3), axis=1)
        # A floor that goes on beyond a label's part is a field that labels stand in.
        colors[floor if within[floor].all() else flush & within] = label_color
    flat = np.arange(3 * len(triangles)).reshape(-1, 3)
    return Surface(corners.reshape(-1, 3), flat, colors.repeat(3, axis=0), smooth=False)


def _beneath(points: Floats, place: LabelPlace, slack: float) -> Booleans:
    """(n,) whether points lie above or below a region, or beside it by no more than a slack: the
    finished shape is a little off the one that was laid out."""
    inside = np.ones(len(points), dtype=bool)
    for start, end in zip(place.region, np.roll(place.region, -1, axis=0), strict=True):
        inward = np.cross(place.normal, end - start)
        inside &= (points - start) @ inward >= -slack * np.linalg.norm(inward)
    return inside


def _draw(die: FinishedDie) -> bytes:
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
        surface = painted(die.engraved.points, die.engraved.triangles, mine)
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
    return reading_figure(surface, down, ups[-1], sides, die.reading.sentence).png()


FIGURES.register(
    Figure(
        name="reading",
        line="the die at rest, and the label that is read then",
        rank=55,
        title="How to read the die",
        caption="The die as it lies after one of its outcomes, and the label to read.",
        wanted=lambda die: die.engraved is not None and die.reading is not None,
        draw=_draw,
    )
)
