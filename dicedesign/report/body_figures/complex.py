"""The Morse-Smale complex over the Gauss map, as in figure 8 of the paper."""

from __future__ import annotations

from dicedesign.report.body_figures.body_figure import BODY_FIGURES, BodyFigure
from dicedesign.report.figures.gauss_map import gauss_map_figure

BODY_FIGURES.register(
    BodyFigure(
        name="complex",
        line="Morse-Smale complex over the Gauss map: basins, separatrices, rests, saddles, maxima",
        rank=30,
        draw=lambda subject: gauss_map_figure(subject.poses, subject.lain.labels),
    )
)
