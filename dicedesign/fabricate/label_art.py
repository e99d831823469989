"""Outlines of labels as plane sections: text, pips or an icon.

Lengths are in digit heights.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, OpType

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import BUNDLED_FONT, EngravingOptions
from dicedesign.fabricate.fonts import CHORD_TOLERANCE, open_font
from dicedesign.fabricate.icons import icon_section
from dicedesign.runtime.arrays import Floats

LINE_SPACING = 1.45
"""Distance between the baselines of two lines."""

MOST_LINES = 4
"""Largest number of lines of a text."""


def text_contours(text: str, font: str = BUNDLED_FONT) -> list[Floats]:
    """Outlines (n, 2) of a text, in digit heights.

    Closed contours without a repeated last point, of any orientation, with curves flattened to
    within `CHORD_TOLERANCE`. The widest line starts at x = 0.

    text: in one or more lines; font: see `open_font`.

    Raises
    ------
    InputError: there is no such font.
    EngravingError: the font lacks a character.
    """
    opened = open_font(font)
    lines = [opened.line(line) for line in text.split("\n")]
    widest = max(width for _, width in lines)
    return [
        outline + np.array([0.5 * (widest - width), LINE_SPACING * above])
        for above, (outlines, width) in zip(range(len(lines))[::-1], lines, strict=True)
        for outline in outlines
    ]


def line_breaks(text: str, font: str = BUNDLED_FONT) -> Iterator[str]:
    """Yield a text in one line, in two and so on, broken at spaces so that the widest line is
    narrowest. Parameters and errors as for `text_contours`."""
    words, opened = text.split(" "), open_font(font)
    widths = [opened.line(word)[1] for word in words]
    space = opened.line(" ")[1] if len(words) > 1 else 0.0

    def widest(spans: list[tuple[int, int]]) -> float:
        return max(sum(widths[i:j]) + space * (j - i - 1) for i, j in spans)

    for lines in range(1, min(len(words), MOST_LINES) + 1):
        breaks = combinations(range(1, len(words)), lines - 1)
        best = min((list(pairwise((0, *each, len(words)))) for each in breaks), key=widest)
        yield "\n".join(" ".join(words[i:j]) for i, j in best)


def text_section(text: str, font: str = BUNDLED_FONT) -> CrossSection:
    """Plane section of a text, in digit heights.

    Parameters and errors as for `text_contours`; also raises EngravingError if the text draws
    nothing.
    """
    # Contours of TrueType fonts are clockwise, others are not, and those of variable fonts overlap.
    section = CrossSection(text_contours(text, font), FillRule.NonZero)
    if section.area() <= 0.0:
        raise EngravingError(
            f"label {text!r}: expected outlines of positive area, got {section.area():g}; use at "
            "least one visible character"
        )
    return section


BAR_GAP = 0.16
"""Distance from the baseline down to the bar of an ambiguous label, in digit heights."""

BAR_THICKNESS = 0.16
"""Thickness of the bar, in digit heights."""

DOT_GAP = 0.14
"""Distance from an ambiguous label to the dot after it, in digit heights."""

DOT_DIAMETER = 0.24
"""Diameter of the dot, in digit heights."""

DOT_CORNERS = 32

TURNED = {"0": "0", "1": "1", "6": "9", "8": "8", "9": "6"}
"""Digits that remain digits when turned by 180 degrees."""


def reads_upside_down(text: str) -> bool:
    """Whether the text, turned by 180 degrees, reads as a different number ("6", "16", "68").

    Turned texts that start with a zero, such as "01" from "10", do not count.
    """
    if not text or not set(text) <= set(TURNED):
        return False
    turned = "".join(TURNED[digit] for digit in reversed(text))
    return turned != text and turned[0] != "0"


def add_mark(section: CrossSection, mark: str) -> CrossSection:
    """Add a bar beneath a number, as wide as it ("bar"), a dot on the baseline after it ("dot"), or
    nothing ("none").

    section: of positive area, in digit heights, with the baseline at y = 0.
    """
    left, _, right, _ = section.bounds()
    if mark == "bar":
        bar = CrossSection.square((right - left, BAR_THICKNESS))
        return section + bar.translate((left, -BAR_GAP - BAR_THICKNESS))
    if mark == "dot":
        radius = 0.5 * DOT_DIAMETER
        dot = CrossSection.circle(radius, DOT_CORNERS)
        return section + dot.translate((right + DOT_GAP + radius, radius))
    return section


FULLNESS = 0.64
"""Diameter of a pip, over the distance between pips."""

PATTERNS = {
    1: "... .x. ...",
    2: "..x ... x..",
    3: "..x .x. x..",
    4: "x.x ... x.x",
    5: "x.x .x. x.x",
    6: "x.x x.x x.x",
    7: "x.x xxx x.x",
    8: "xxx x.x xxx",
    9: "xxx xxx xxx",
}
"""Rows of a square grid from the top; each x is a pip."""

ROWS = {
    10: "343",
    11: "434",
    12: "444",
    13: "32323",
    14: "3443",
    15: "33333",
    16: "4444",
    17: "34343",
    18: "43434",
    19: "44344",
    20: "44444",
}
"""Number of pips in each centered row, from the top, of numbers without a usual pattern."""

MOST_PIPS = max(ROWS)


def pip_places(number: int) -> tuple[Floats, float]:
    """Middles (n, 2) of the pips of a number from 1 to `MOST_PIPS`, in the unit square, and their
    diameter."""
    rows: list[list[float]]
    if number in PATTERNS:
        patterns = PATTERNS[number].split()
        rows = [[x for x, sign in enumerate(signs, -1) if sign == "x"] for signs in patterns]
        steps = 2
    else:
        counts = [int(count) for count in ROWS[number]]
        rows = [[x - 0.5 * (count - 1) for x in range(count)] for count in counts]
        steps = max(len(rows), *counts) - 1
    spacing, top = 1.0 / (steps + FULLNESS), 0.5 * (len(rows) - 1)
    places = np.array([(x, top - row) for row, pips in enumerate(rows) for x in pips])
    return 0.5 + spacing * places, FULLNESS * spacing


def pips_section(text: str) -> CrossSection:
    """Plane section of a number as pips, in the unit square.

    Raises EngravingError: the text is no whole number from 1 to `MOST_PIPS`.
    """
    number = int(text) if text.isascii() and text.isdigit() else 0
    if not 1 <= number <= MOST_PIPS:
        raise EngravingError(
            f"label {text!r}: expected a whole number from 1 to {MOST_PIPS} to show as pips, got "
            "another label; leave pips out, or give it an icon"
        )
    places, diameter = pip_places(number)
    radius = 0.5 * diameter
    # The polygon is within the tolerance of the circle.
    corners = int(np.ceil(np.pi / np.sqrt(2.0 * CHORD_TOLERANCE / radius)))
    corners += -corners % 8
    disc = CrossSection.circle(radius, corners)
    return CrossSection.batch_boolean([disc.translate((x, y)) for x, y in places], OpType.Add)


MITER = 2.0
"""Largest length of a sharp corner, over the distance of the offset."""

CORNERS = 0.1
"""Largest length of a corner outside the discs that cover a stroke, over their diameter."""

HALVINGS = 10
"""Number of bisections of the growth of strokes."""


def holes_and_parts(section: CrossSection) -> tuple[int, int]:
    """Numbers of holes and of separate parts of a section."""
    parts = len(section.decompose())
    return section.num_contour() - parts, parts


def grown(section: CrossSection, distance: float) -> CrossSection:
    """Offset a section outward by a distance, or inward where it is negative, with sharp
    corners."""
    if distance == 0.0:
        return section
    return section.offset(distance, JoinType.Miter, MITER)


def _covers(section: CrossSection, whole: CrossSection, width: float) -> bool:
    """Whether discs of a diameter inside the whole cover a section, except at corners."""
    opened = grown(grown(whole, -0.5 * width), 0.5 * width)
    left = section - opened
    if left.is_empty():
        return True
    # Corners are narrow and near the discs; hairlines lead away from them.
    is_narrow = grown(left, -0.5 * CORNERS * width).is_empty()
    return is_narrow and (left - grown(opened, width)).is_empty()


@dataclass(frozen=True, eq=False)
class LabelArt:
    """Outlines of a label of digit height 1.

    Attributes
    ----------
    section: of positive area; the baseline of text is y = 0.
    box: left, bottom, right and top of the section, or of the square around the pips of any number.
    """

    section: CrossSection
    box: tuple[float, float, float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the box."""
        left, bottom, right, top = self.box
        return right - left, top - bottom

    def growth(self, height: float, stroke: float) -> float:
        """Least outward offset of the outlines at which strokes have a width, or 0 if they have it
        already; all in mm, at a digit height.

        A stroke has a width if discs of that diameter inside the grown section cover it, except at
        corners.
        """
        width = stroke / height
        if width <= 0.0 or _covers(self.section, self.section, width):
            return 0.0
        low, high = 0.0, 0.5 * width
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if _covers(self.section, grown(self.section, middle), width):
                high = middle
            else:
                low = middle
        return height * high


def label_arts(text: str, options: EngravingOptions) -> list[LabelArt]:
    """Possible outlines of a label: its icon if it has one, else pips or text, with a mark if it is
    another number upside down; text with spaces in one line, in two and so on.

    Raises
    ------
    InputError: the font or the icon cannot be read.
    EngravingError: the label cannot be drawn.
    """
    if text in options.icons:
        sections = [icon_section(options.icons[text], text)]
    elif options.content == "pips":
        return [LabelArt(pips_section(text), (0.0, 0.0, 1.0, 1.0))]
    elif reads_upside_down(text):
        sections = [add_mark(text_section(text, options.font), options.ambiguous)]
    else:
        broken = line_breaks(text, options.font)
        sections = [text_section(lines, options.font) for lines in broken]
    return [LabelArt(section, section.bounds()) for section in sections]
