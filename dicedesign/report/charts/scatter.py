"""Distances between predictions of the same bodies' rests, against the bodies' asymmetry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.report.charts.axes import Axis
from dicedesign.report.charts.chart import Chart, draw_legend, legend_height
from dicedesign.report.charts.palette import DARK, DISTINCT, FAINT
from dicedesign.report.charts.paper import NOTE, TITLE, Paper
from dicedesign.report.charts.series import Curve, Style
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.correlation import correlation

__all__ = ["asymmetry_scatter_figure", "density"]

_BOX: Final = (115.0, 230.0, 895.0, 815.0)
"""Pixels of the scatter plot."""

_DENSITY: Final = 140.0
"""Pixels between the axis and the highest value of the plots of densities."""

_GAP: Final = 15.0

_POINTS: Final = 256


def asymmetry_scatter_figure(
    asymmetry: Floats, distances: Mapping[str, Floats], title: str, note: str = ""
) -> Paper:
    """A point for each body and comparison, with the densities of the distances on top and of the
    asymmetry on the right; the legend gives each comparison's Pearson correlation with its 95 %
    interval and p-value.

    Parameters
    ----------
    asymmetry: (n,) measure rho of each body, at least 0.
    distances: what is compared -> (n,) Wasserstein distances in radians, at least 0; up to 7.
    title: above the figure.
    note: small print at the foot.

    Raises
    ------
    InputError: there is nothing to compare, a value is negative, or as `correlation`.

    Source: figure 10.
    """
    if not 1 <= len(distances) <= len(DISTINCT):
        raise InputError(
            f"asymmetry scatter: expected 1 to {len(DISTINCT)} comparisons, got {len(distances)}; "
            "draw more in figures of their own"
        )
    labels = [f"{name}: {correlation(asymmetry, d)}" for name, d in distances.items()]
    lowest = min(float(values.min()) for values in (asymmetry, *distances.values()))
    if lowest < 0.0:
        raise InputError(
            f"asymmetry scatter: expected distances and asymmetries of at least 0, got {lowest:g}; "
            "pass Wasserstein distances and rho"
        )
    left, top, right, bottom = _BOX
    most = 1.05 * max(float(values.max()) for values in distances.values())
    highest = 1.05 * float(asymmetry.max())
    styles = [Style(color, "", marker="o", size=3.2) for color in DISTINCT]
    chart = Chart(
        _BOX,
        Axis(0.0, most, "Wasserstein distance W (rad)"),
        Axis(0.0, highest, "asymmetry ρ"),
    )
    # Body after body, so that no comparison lies on top of all others.
    for body, height in enumerate(asymmetry):
        for values, style in zip(distances.values(), styles, strict=False):
            chart.series.append(Curve(values[body : body + 1], [height], style))
    keys = [Curve([], [], s, label) for s, label in zip(styles, labels, strict=False)]
    foot = bottom + 80.0
    paper = Paper(right + _GAP + _DENSITY + 30.0, foot + legend_height(keys, 1) + 50.0)
    chart.draw(paper)
    above = [density(values, most) for values in distances.values()]
    tallest = max(float(heights.max()) for _, heights in above)
    for (places, heights), color in zip(above, DISTINCT, strict=False):
        x, _ = chart.places(places, np.zeros(_POINTS)).T
        line = np.stack([x, top - _GAP - _DENSITY * heights / tallest], axis=1)
        _hill(paper, line, [(right, top - _GAP), (left, top - _GAP)], color)
    places, heights = density(asymmetry, highest)
    _, y = chart.places(np.zeros(_POINTS), places).T
    line = np.stack([right + _GAP + _DENSITY * heights / heights.max(), y], axis=1)
    _hill(paper, line, [(right + _GAP, top), (right + _GAP, bottom)], DARK)
    paper.text(title, (left, 30.0), size=TITLE, anchor="lm")
    draw_legend(paper, keys, (left, foot), columns=1, align="left")
    paper.text(note, (left, paper.height - 14.0), size=NOTE, anchor="ld", color=FAINT)
    return paper


def _hill(paper: Paper, line: Floats, foot: list[tuple[float, float]], color: str) -> None:
    """Draw a density and fill it down to its foot."""
    paper.polygon(np.concatenate([line, foot]), color, 0.12)
    paper.line(line, color, 2.8)


def density(values: Floats, most: float) -> tuple[Floats, Floats]:
    """(256,) places from 0 to `most` and the density of values (n,), at least 0, at them: a
    Gaussian kernel estimate of the width by Scott's rule whose part below 0 is folded back."""
    from scipy.stats import gaussian_kde

    estimate = gaussian_kde(values)
    places = np.linspace(0.0, most, _POINTS)
    return places, estimate(places) + estimate(-places)
