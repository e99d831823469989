"""Measure figures by their pixels and by the content of their axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from dicedesign.palette import rgb
from dicedesign.report.sheet import Sheet


def color_mask(sheet: Sheet, color: str) -> np.ndarray:
    """(h, w) mask of the pixels of a color."""
    expected = np.rint(255.0 * rgb([color])[0])
    return (np.abs(sheet.pixels() - expected) <= 2).all(axis=2)


def is_whole(sheet: Sheet) -> bool:
    """Whether the drawing stays clear of the borders."""
    ink = (sheet.pixels() < 250).any(axis=2)
    return not (ink[[0, -1]].any() or ink[:, [0, -1]].any()) and bool(ink.any())


def curves(axes: Axes) -> dict[str, np.ndarray]:
    """Points (n, 2) of each labeled curve."""
    return {
        line.get_label(): np.asarray(line.get_xydata(), dtype=float)
        for line in axes.lines
        if not str(line.get_label()).startswith("_")
    }
