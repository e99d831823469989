"""Pictures in rows, pixel for pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dicedesign.report.charts.palette import DARK
from dicedesign.report.charts.png import PIXELS_PER_INCH, agg_figure

__all__ = ["picture_grid", "trimmed"]

Picture = NDArray[np.uint8]

_GAP: Final = 0.16

_MARGIN_ROWS: Final = 8

_TITLE: Final = 0.28


def trimmed(pictures: Sequence[Picture]) -> list[Picture]:
    """Pictures (h, w, 3) of one size without the rows above and below that are white in all of
    them, but for a margin."""
    used = np.flatnonzero((np.stack(pictures) < 255).any(axis=(0, 2, 3)))
    if len(used) == 0:
        return list(pictures)
    rows = slice(max(int(used[0]) - _MARGIN_ROWS, 0), int(used[-1]) + 1 + _MARGIN_ROWS)
    return [picture[rows] for picture in pictures]


def picture_grid(
    pictures: Sequence[Picture],
    titles: Sequence[str],
    columns: int,
    above: float = 0.0,
    below: float = 0.0,
) -> Figure:
    """Pictures in rows with a title above each.

    pictures: (h, w, 3), at least one, of one width, and of one height in each row; titles: one for
    each, empty where there is none; columns: of the grid, at least 1; above, below: inches of room
    left free for more.
    """
    side = pictures[0].shape[1] / PIXELS_PER_INCH
    sides = [len(picture) / PIXELS_PER_INCH for picture in pictures]
    width = columns * (side + _GAP) + _GAP
    height = sum(sides[::columns]) + len(sides[::columns]) * (_GAP + _TITLE) + _GAP + above + below
    figure = agg_figure(width, height)
    top = height - above - _GAP
    for k, (picture, title) in enumerate(zip(pictures, titles, strict=True)):
        left = _GAP + (k % columns) * (side + _GAP)
        bottom = top - _TITLE - sides[k]
        box = (left / width, bottom / height, side / width, sides[k] / height)
        # With its height given, a title is not moved clear of ticks, which are not drawn here.
        axes = figure.add_axes(box, xticks=[], yticks=[])
        axes.imshow(picture)
        axes.set_axis_off()
        axes.set_title(title, fontsize=10, color=DARK, pad=3, y=1.0, parse_math=False)
        if k % columns == columns - 1:
            top = bottom - _GAP
    return figure
