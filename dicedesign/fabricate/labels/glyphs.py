"""Label outlines: text as closed contours and as a plane section to extrude.

The font is DejaVu Sans Bold, which ships with matplotlib; its digits are all equally wide.
Lengths are in units of the digit height, the baseline is y = 0 and the text starts at x = 0.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from fontTools.pens.basePen import BasePen
from fontTools.ttLib import TTFont
from manifold3d import CrossSection

from dicedesign.errors import EngravingError
from dicedesign.runtime.arrays import Floats

__all__ = [
    "CHORD_TOLERANCE",
    "label_contours",
    "reads_upside_down",
    "require_glyphs",
    "text_contours",
    "text_section",
]

CHORD_TOLERANCE: Final = 1e-3
"""Largest distance between a curve of the font and the polyline drawn for it, in digit heights."""

BAR_GAP: Final = 0.16
"""Distance from the baseline down to the bar of an ambiguous label, in digit heights."""

BAR_THICKNESS: Final = 0.16
"""Thickness of that bar, in digit heights."""

FONT_FILE: Final = Path("mpl-data", "fonts", "ttf", "DejaVuSans-Bold.ttf")
"""Of the font, in the folder of matplotlib."""

TURNED: Final = {"0": "0", "1": "1", "6": "9", "8": "8", "9": "6"}
"""Digits that are digits when they are turned by 180 degrees, and which."""


class _PolylinePen(BasePen):
    """Collects the contours of a glyph as lists of points, with curves flattened."""

    def __init__(self, glyph_set: Any, tolerance: float) -> None:
        super().__init__(glyph_set)
        self.tolerance = tolerance
        self.contours: list[list[tuple[float, float]]] = []

    def _moveTo(self, pt: tuple[float, float]) -> None:
        self.contours.append([pt])

    def _lineTo(self, pt: tuple[float, float]) -> None:
        self.contours[-1].append(pt)

    def _qCurveToOne(self, pt1: tuple[float, float], pt2: tuple[float, float]) -> None:
        start, control, end = np.array([self.contours[-1][-1], pt1, pt2], dtype=np.float64)
        # A parabola split at n equal parameters leaves its chords by |second difference| / 4n^2.
        bend = float(np.linalg.norm(start - 2 * control + end))
        pieces = max(1, math.ceil(math.sqrt(bend / (4 * self.tolerance))))
        for t in np.arange(1, pieces) / pieces:
            x, y = (1 - t) ** 2 * start + 2 * t * (1 - t) * control + t**2 * end
            self.contours[-1].append((float(x), float(y)))
        self.contours[-1].append(pt2)


@cache
def _font() -> TTFont:
    spec = importlib.util.find_spec("matplotlib")
    folders = spec.submodule_search_locations if spec else None
    path = Path(folders[0], FONT_FILE) if folders else FONT_FILE
    if not path.is_file():
        raise EngravingError(
            f"label font: expected {path} in the installed package matplotlib, got no such file; "
            "reinstall matplotlib from its wheel"
        )
    return TTFont(path)


@cache
def _glyph(character: str) -> tuple[tuple[Floats, ...], float]:
    """Contours of one character that starts at x = 0, and its advance width, in digit heights."""
    font = _font()
    name = font.getBestCmap().get(ord(character))
    if name is None:
        raise EngravingError(
            f"label: expected characters of the font DejaVu Sans Bold, got {character!r} "
            f"(U+{ord(character):04X}); use digits, letters or signs that it has"
        )
    unit = float(font["glyf"]["one"].yMax)
    glyphs = font.getGlyphSet()
    pen = _PolylinePen(glyphs, CHORD_TOLERANCE * unit)
    glyphs[name].draw(pen)
    contours = []
    for points in pen.contours:
        if points[0] == points[-1]:
            points = points[:-1]
        if len(points) > 2:  # the font also has lone points, which only mark places
            # TrueType runs outer contours clockwise; here they run counter-clockwise.
            contours.append(np.array(points[::-1], dtype=np.float64) / unit)
    return tuple(contours), glyphs[name].width / unit


def text_contours(text: str) -> list[Floats]:
    """Outlines of a text.

    Parameters
    ----------
    text: the characters to draw, left to right, each as wide as the font's advance width.

    Returns
    -------
    list of (n, 2), in digit heights: closed contours without a repeated last point, outer
    ones counter-clockwise, holes clockwise; curves are flattened to within `CHORD_TOLERANCE`.

    Raises
    ------
    EngravingError: the font lacks a character, or is not installed.
    """
    contours: list[Floats] = []
    start = 0.0
    for character in text:
        outlines, advance = _glyph(character)
        contours += [outline + np.array([start, 0.0]) for outline in outlines]
        start += advance
    return contours


def reads_upside_down(text: str) -> bool:
    """True if the text, turned by 180 degrees, reads as a different number ("6", "16", "68").

    Turned texts that start with a zero ("10" gives "01") are no numbers and do not count.
    """
    if not text or not set(text) <= set(TURNED):
        return False
    turned = "".join(TURNED[digit] for digit in reversed(text))
    return turned != text and (len(turned) == 1 or turned[0] != "0")


def require_glyphs(labels: Iterable[str]) -> None:
    """Raise EngravingError where the font lacks a character of a label."""
    for label in labels:
        label_contours(label)


def label_contours(text: str) -> list[Floats]:
    """Outlines of a label: those of its text, and a bar beneath if it reads upside down.

    Parameters
    ----------
    text: the label.

    Returns
    -------
    list of (n, 2), in digit heights, as `text_contours` gives them; the bar comes last and
    is as wide as the text.

    Raises
    ------
    EngravingError: as `text_contours`.
    """
    contours = text_contours(text)
    if reads_upside_down(text):
        points = np.concatenate(contours)
        left, right = points[:, 0].min(), points[:, 0].max()
        top, bottom = -BAR_GAP, -BAR_GAP - BAR_THICKNESS
        contours.append(np.array([(left, bottom), (right, bottom), (right, top), (left, top)]))
    return contours


def text_section(text: str) -> CrossSection:
    """Plane section of a label, the bar of an ambiguous one included, in digit heights.

    Parameters
    ----------
    text: the label.

    Returns
    -------
    CrossSection of positive area.

    Raises
    ------
    EngravingError: the label draws nothing, or as `text_contours`.
    """
    section = CrossSection(label_contours(text))
    if section.area() <= 0.0:
        raise EngravingError(
            f"label {text!r}: expected outlines of positive area, got {section.area():g}; use at "
            "least one visible character"
        )
    return section
