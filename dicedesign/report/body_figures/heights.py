"""The height of a body's center of mass over its Gauss map, as in figure 4 of the paper."""

from __future__ import annotations

from typing import Final

import numpy as np

from dicedesign.report.body_figures.body_figure import BODY_FIGURES, BodyFigure
from dicedesign.report.charts.palette import DARK, LOW_TO_HIGH, rgb
from dicedesign.report.charts.paper import NOTE, Paper, Picture
from dicedesign.report.figures.gauss_map import complex_figure
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["heights_figure"]

_BAR: Final = (260.0, 16.0)
"""Pixels of the scale of colours."""


def heights_figure(poses: RestPoses) -> Paper:
    """The support function by colour, with separatrices and stationary points, as two equal-area
    discs: it is lowest at the rests, and has creases on the arcs of the hull's edges."""
    hull, center = poses.hull, poses.center_of_mass
    lowest = float(hull.heights(center).min())
    highest = float(np.sqrt(((hull.vertices - center) ** 2).sum(-1)).max())

    def painter(directions: Floats, rests: Integers) -> Picture:
        heights = np.stack([(row @ (hull.vertices - center).T).max(-1) for row in directions])
        return _colors((heights - lowest) / max(highest - lowest, np.finfo(np.float64).tiny))

    note = "Its colour tells how high the center of mass then is."
    paper = complex_figure(poses, painter, note)
    middle, top = paper.width / 2.0, paper.height - 77.0
    steps = np.linspace(-0.5, 0.5, 131) * _BAR[0]
    for left, right, (red, green, blue) in zip(
        steps[:-1], steps[1:], _colors(np.linspace(0.0, 1.0, 130)).tolist(), strict=True
    ):
        color = f"#{red:02x}{green:02x}{blue:02x}"
        paper.box(middle + left, top, middle + right, top + _BAR[1], color)
    for value, side, anchor in ((lowest, -1.0, "rm"), (highest, 1.0, "lm")):
        place = (middle + side * (_BAR[0] / 2.0 + 10.0), top + _BAR[1] / 2.0)
        paper.text(f"{value:.4g}", place, size=NOTE, anchor=anchor, color=DARK)
    return paper


def _colors(parts: Floats) -> Picture:
    """(..., 3) colours of parts (...) from 0 to 1 of what is highest."""
    anchors = rgb(LOW_TO_HIGH)
    places = np.linspace(0.0, 1.0, len(anchors))
    mixed = [np.interp(parts, places, channel) for channel in anchors.T]
    return np.rint(255.0 * np.stack(mixed, axis=-1)).astype(np.uint8)


BODY_FIGURES.register(
    BodyFigure(
        name="heights",
        line="height of the center of mass over the Gauss map, by colour",
        rank=10,
        draw=lambda subject: heights_figure(subject.poses),
    )
)
