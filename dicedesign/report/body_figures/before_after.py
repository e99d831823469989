"""A body and what it was made from, as in figures 13 to 15 of the paper."""

from __future__ import annotations

import numpy as np

from dicedesign.report.body_figures.body_figure import BODY_FIGURES, BodyFigure, Subject
from dicedesign.report.charts.paper import Paper
from dicedesign.report.figures.before_after import before_after_figure
from dicedesign.report.render.cameras import three_cameras


def _draw(subject: Subject) -> Paper:
    before, after = subject.make_before(subject.lain), subject.surface
    points = np.concatenate([before.points, after.points])
    return before_after_figure(before, after, three_cameras(points, subject.upward))


BODY_FIGURES.register(
    BodyFigure(
        name="before_after",
        line="a die above the shape that its design began with, or a mesh above another (--before)",
        rank=50,
        draw=_draw,
    )
)
