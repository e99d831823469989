"""Each label of the die, seen straight from outside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.picture_grid import picture_grid
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.report.render.raster import Camera
from dicedesign.report.render.renderer import Surface, render
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.finished_die import FinishedDie

__all__ = ["labels_figure"]

_PIXELS: Final = 240

_COLUMNS: Final = 6

_FRAME: Final = 1.15
"""Side of a picture, over the extent of its facet."""

_PLANE_TOLERANCE: Final = 1e-4


def labels_figure(
    points: Floats, triangles: Integers, normals: Floats, ups: Floats, titles: Sequence[str]
) -> Paper:
    """Each facet of a solid seen straight from outside, filling its picture.

    Parameters
    ----------
    points: (n, 3) in any length unit, corners of the facets among them.
    triangles: (t, 3).
    normals: (k, 3) outward normals of the facets to show; k at least 1.
    ups: (k, 3) directions upward on the pictures; not parallel to the normals.
    titles: k texts.

    Raises
    ------
    InputError: there is no facet, or not one normal, up and title for each.
    """
    if not 0 < len(normals) == len(ups) == len(titles):
        raise InputError(
            "facets: expected at least one, with one normal, one up direction and one title each, "
            f"got {len(normals)} normals, {len(ups)} up directions and {len(titles)} titles"
        )
    extent = float(np.ptp(points, axis=0).max())
    surface = Surface(points, triangles, smooth=False)
    pictures = []
    for normal, up in zip(normals, ups, strict=True):
        heights = points @ (normal / np.linalg.norm(normal))
        facet = points[heights >= heights.max() - _PLANE_TOLERANCE * extent]
        frame = Camera(normal, up, facet[0], 1.0).frame()
        low, high = (facet @ frame.T).min(axis=0), (facet @ frame.T).max(axis=0)
        half_width = _FRAME * float((high - low).max()) / 2.0
        camera = Camera(normal, up, (low + high) / 2.0 @ frame, half_width)
        pictures.append(render(surface, camera, _PIXELS))
    return picture_grid(pictures, titles, min(_COLUMNS, len(pictures)))


def _draw(die: FinishedDie) -> bytes:
    assert die.engraved is not None
    frames = np.array([placement.frame for placement in die.engraved.placements])
    return labels_figure(
        die.engraved.points,
        die.engraved.triangles,
        frames[:, :3, 2],
        frames[:, :3, 1],
        [placement.text for placement in die.engraved.placements],
    ).png()


FIGURES.register(
    Figure(
        name="labels",
        line="each label seen straight from outside",
        rank=60,
        title="Every label",
        caption="Each labelled facet seen straight from outside.",
        wanted=lambda die: die.engraved is not None and len(die.engraved.placements) > 0,
        draw=_draw,
    )
)
