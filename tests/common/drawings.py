"""Measure figures by their pixels, their texts and the content of their axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from dicedesign.palette import rgb
from dicedesign.report.raster import decode_png
from dicedesign.report.sheet import Sheet, figure_bytes


def pixels(figure: Figure) -> np.ndarray:
    """Picture (h, w, 3) of a figure."""
    return decode_png(figure_bytes(figure, ".png"))


def written(figure: Figure) -> list[Text]:
    """Visible texts of a figure, without tick labels."""
    texts = [one for one in figure.findobj(Text) if isinstance(one, Text)]
    return [text for text in texts if text.get_text() and text.get_visible()]


def words(figure: Figure) -> list[str]:
    """What is written on a figure, with line breaks as spaces."""
    return [text.get_text().replace("\n", " ") for text in written(figure)]


def pictures(sheet: Sheet) -> list[np.ndarray]:
    """Pictures pasted on a sheet, in their order."""
    return [np.asarray(image.get_array()) for image in sheet.drawing.images]


def color_mask(figure: Figure, color: str) -> np.ndarray:
    """(h, w) mask of the pixels of a color."""
    expected = np.rint(255.0 * rgb([color])[0])
    return (np.abs(pixels(figure) - expected) <= 2).all(axis=2)


def is_whole(figure: Figure) -> bool:
    """Whether the drawing stays clear of the borders."""
    ink = (pixels(figure) < 250).any(axis=2)
    return not (ink[[0, -1]].any() or ink[:, [0, -1]].any()) and bool(ink.any())


def curves(axes: Axes) -> dict[str, np.ndarray]:
    """Points (n, 2) of each labeled curve."""
    return {
        line.get_label(): np.asarray(line.get_xydata(), dtype=float)
        for line in axes.lines
        if not str(line.get_label()).startswith("_")
    }
