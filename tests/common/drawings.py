"""Drawings measured by their pixels."""

from __future__ import annotations

import numpy as np

from dicedesign.report.charts.chart import Chart
from dicedesign.report.charts.palette import rgb
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.series import Curve


def painted(paper: Paper, color: str) -> np.ndarray:
    """(h, w) pixels of a colour."""
    wanted = np.rint(255.0 * rgb([color])[0])
    return (np.abs(paper.pixels() - wanted) <= 2).all(axis=2)


def is_whole(paper: Paper) -> bool:
    """Whether nothing reaches the borders of the sheet."""
    ink = (paper.pixels() < 250).any(axis=2)
    return not (ink[[0, -1]].any() or ink[:, [0, -1]].any()) and bool(ink.any())


def curves(chart: Chart) -> dict[str, np.ndarray]:
    """Points (n, 2) of labelled curves."""
    return {
        one.label: np.stack([one.x, one.y], axis=1)
        for one in chart.series
        if isinstance(one, Curve) and one.label
    }
