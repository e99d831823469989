"""Outlines of labels as plane sections: text, pips or an icon.

Lengths are in digit heights.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, OpType

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import BUNDLED_FONT, EngravingOptions
from dicedesign.fabricate.fonts import CHORD_TOLERANCE, open_font
from dicedesign.fabricate.icons import icon_section
from dicedesign.runtime.arrays import Floats

LINE_SPACINGS = (1.45, 1.25)
"""Distances between the baselines of two lines, of usual and of narrow characters."""

NARROW = 0.9
"""Width of narrow characters, over the usual one, as in condensed faces of the bundled font."""

SPACED = 0.06
"""Distance between narrow characters beyond the font's, in digit heights."""

MOST_LINES = 4
"""Largest number of lines of a text."""


def text_contours(text: str, font: str = BUNDLED_FONT, is_narrow: bool = False) -> list[Floats]:
    """Outlines (n, 2) of a text, in digit heights.

    Closed contours without a repeated last point, of any orientation, with curves flattened to
    within `CHORD_TOLERANCE`. The widest line starts at x = 0.

    text: in one or more lines; font: see `open_font`; is_narrow: whether characters are `NARROW`
    and `SPACED`.

    Raises
    ------
    InputError: there is no such font.
    EngravingError: the font lacks a character.
    """
    opened = open_font(font)
    spacing = 0.0 if text.isdigit() else SPACED * is_narrow
    lines = [opened.line(line, spacing) for line in text.split("\n")]
    widest = max(width for _, width in lines)
    scale, pitch = np.array([NARROW if is_narrow else 1.0, 1.0]), LINE_SPACINGS[is_narrow]
    return [
        scale * (outline + np.array([0.5 * (widest - width), pitch * above]))
        for above, (outlines, width) in zip(range(len(lines))[::-1], lines, strict=True)
        for outline in outlines
    ]


VOWELS = "aeiouyàâäáåæèéêëìíîïòóôöøùúûü"

CONSONANT = rf"[^\W\d_{VOWELS}]"

SYLLABLES = re.compile(
    f"\u00ad|(?<=[{VOWELS}]{CONSONANT})(?=(?![hk]|(?<=[bcdfgkptv])[lr]){CONSONANT}[{VOWELS}])"
    "|(?<=[dlnrt]u)(?=a)",
    re.IGNORECASE,
)
"""Where a word may be hyphenated: at soft hyphens, between two consonants between vowels, as in
Sep-tem-ber, unless they are one sound or begin a syllable, and as in Janu-ary."""

LINE_ENDS = {" ": "\n", "\u00ad": "-\n"}
"""What a space and a soft hyphen become where a line ends."""


def line_breaks(text: str, font: str = BUNDLED_FONT) -> Iterator[str]:
    """Yield a text in one line, in two and so on, broken at spaces so that the widest line is
    narrowest; then those with hyphens in words. Parameters and errors as for `text_contours`."""
    opened, parted = open_font(font), SYLLABLES.sub("\u00ad", text)
    width = cache(lambda line: opened.line(line)[1])
    for ends in " ", LINE_ENDS:
        spots = [at for at, character in enumerate(parted) if character in ends]
        for breaks in range(min(len(spots), MOST_LINES - 1) + 1):
            choices = [
                "".join(
                    LINE_ENDS[one] if at in chosen else one for at, one in enumerate(parted)
                ).replace("\u00ad", "")
                for chosen in combinations(spots, breaks)
            ]
            best = min(choices, key=lambda each: max(map(width, each.split("\n"))))
            if ends == " " or "-\n" in best:
                yield best


def text_section(text: str, font: str = BUNDLED_FONT, is_narrow: bool = False) -> CrossSection:
    """Plane section of a text, in digit heights.

    Parameters and errors as for `text_contours`; also raises EngravingError if the text draws
    nothing.
    """
    # Contours of TrueType fonts are clockwise, others are not, and those of variable fonts overlap.
    section = CrossSection(text_contours(text, font, is_narrow), FillRule.NonZero)
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


def upside_down(text: str) -> str:
    """What digits read as when turned by 180 degrees: "9" for "6", "91" for "16", or "" for other
    texts."""
    is_turned = set(text) <= set(TURNED)
    return "".join(TURNED[digit] for digit in reversed(text)) if is_turned else ""


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
    hyphens: number of hyphens at ends of lines.
    """

    section: CrossSection
    box: tuple[float, float, float, float]
    hyphens: int = 0

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


def label_arts(text: str, options: EngravingOptions, labels: Collection[str]) -> list[LabelArt]:
    """Possible outlines of a label: its icon if it has one, else pips or text, with a mark if it
    reads as another one of the die's labels upside down; text of several words or syllables in one
    line, in two and so on.

    Raises
    ------
    InputError: the font or the icon cannot be read.
    EngravingError: the label cannot be drawn.
    """
    if text in options.icons:
        section = icon_section(options.icons[text], text)
        return [LabelArt(section, section.bounds())]
    if options.content == "pips":
        return [LabelArt(pips_section(text), (0.0, 0.0, 1.0, 1.0))]
    is_narrow, arts = options.narrow and len(text) > 1, []
    for broken in line_breaks(text.upper() if is_narrow else text, options.font):
        section = text_section(broken, options.font, is_narrow)
        if upside_down(text) in {*labels} - {text}:
            section = add_mark(section, options.ambiguous)
        arts.append(LabelArt(section, section.bounds(), broken.count("-\n")))
    return arts
