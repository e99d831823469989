"""Pictures in rows, pixel for pixel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.report.charts.paper import Paper, Picture

__all__ = ["picture_grid", "trimmed"]

_GAP: Final = 24

_MARGIN_ROWS: Final = 8

_TITLE: Final = 42


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
) -> Paper:
    """Pictures in rows with a title above each.

    pictures: (h, w, 3), at least one, of one width, and of one height in each row; titles: one for
    each, empty where there is none; columns: of the grid, at least 1; above, below: pixels of room
    left free for more.
    """
    width = pictures[0].shape[1]
    rows = [len(picture) for picture in pictures[::columns]]
    tall = sum(rows) + len(rows) * (_GAP + _TITLE) + _GAP
    paper = Paper(columns * (width + _GAP) + _GAP, tall + above + below)
    top = above + _GAP
    for first, height in zip(range(0, len(pictures), columns), rows, strict=True):
        row = slice(first, first + columns)
        for column, (picture, title) in enumerate(zip(pictures[row], titles[row], strict=True)):
            left = _GAP + column * (width + _GAP)
            paper.picture(picture, left, top + _TITLE)
            if title:
                paper.text(title, (left + width / 2.0, top + _TITLE - 7.0), anchor="md")
        top += height + _TITLE + _GAP
    return paper
