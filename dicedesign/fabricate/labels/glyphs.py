"""Text as a plane section.

Lengths are in digit heights. The baseline of the last line is y = 0, and lines are centred.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import Final

import numpy as np
from manifold3d import CrossSection

from dicedesign.errors import EngravingError
from dicedesign.fabricate.labels.fonts import open_font
from dicedesign.fabricate.labels.options import BUNDLED_FONT
from dicedesign.fabricate.outlines.sections import non_zero
from dicedesign.runtime.arrays import Floats

__all__ = ["line_breaks", "text_contours", "text_section"]

LINE_SPACING: Final = 1.45
"""Distance between the baselines of two lines."""

MOST_LINES: Final = 4
"""That a text is broken into."""


def text_contours(text: str, font: str = BUNDLED_FONT) -> list[Floats]:
    """Outlines of a text.

    Parameters
    ----------
    text: the characters to draw, in one or more lines.
    font: as `open_font` takes it.

    Returns
    -------
    list of (n, 2), in digit heights: closed contours without a repeated last point, which wind
    about the inside of the letters in either sense; curves are flattened to within
    `CHORD_TOLERANCE`. The widest line starts at x = 0.

    Raises
    ------
    InputError: there is no such font.
    EngravingError: the font lacks a character.
    """
    opened = open_font(font)
    lines = [opened.line(line) for line in text.split("\n")]
    widest = max((width for _, width in lines), default=0.0)
    contours: list[Floats] = []
    for number, (outlines, width) in enumerate(lines):
        start = np.array([0.5 * (widest - width), LINE_SPACING * (len(lines) - 1 - number)])
        contours += [outline + start for outline in outlines]
    return contours


def line_breaks(text: str, font: str = BUNDLED_FONT) -> Iterator[str]:
    """A text in one line, in two and so on: broken at its spaces, so that the widest line is as
    narrow as it can be.

    Parameters and errors are those of `text_contours`.
    """
    words = text.split(" ")
    opened = open_font(font)
    widths = [opened.line(word)[1] for word in words] if len(words) > 1 else [0.0]
    space = opened.line(" ")[1] if len(words) > 1 else 0.0
    for lines in range(1, min(len(words), MOST_LINES) + 1):
        breaks = min(
            combinations(range(1, len(words)), lines - 1),
            key=lambda inner: max(
                sum(widths[i:j]) + space * (j - i - 1) for i, j in pairwise((0, *inner, len(words)))
            ),
        )
        yield "\n".join(" ".join(words[i:j]) for i, j in pairwise((0, *breaks, len(words))))


def text_section(text: str, font: str = BUNDLED_FONT) -> CrossSection:
    """Plane section of a text, in digit heights.

    Parameters and errors are those of `text_contours`; besides,

    Raises
    ------
    EngravingError: the text draws nothing.
    """
    section = non_zero(text_contours(text, font))
    if section.area() <= 0.0:
        raise EngravingError(
            f"label {text!r}: expected outlines of positive area, got {section.area():g}; use at "
            "least one visible character"
        )
    return section
