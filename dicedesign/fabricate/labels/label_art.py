"""What a label looks like: text, pips or an icon, as a plane section.

Lengths are in digit heights.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from manifold3d import CrossSection

from dicedesign.errors import EngravingError
from dicedesign.fabricate.labels.ambiguity import marked, reads_upside_down
from dicedesign.fabricate.labels.glyphs import line_breaks, text_section
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.fabricate.labels.pips import pips_section
from dicedesign.fabricate.outlines.icons import icon_section
from dicedesign.fabricate.outlines.sections import grown, holes_and_parts, stroke_growth

__all__ = ["LabelArt", "label_arts", "require_art"]


@dataclass(frozen=True, eq=False)
class LabelArt:
    """The art of a label, of digit height 1.

    Attributes
    ----------
    section: of positive area; the baseline of text is y = 0.
    box: left, bottom, right and top of the room that it takes: its bounds, or the square that the
        pips of all numbers share.
    """

    section: CrossSection
    box: tuple[float, float, float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the box."""
        left, bottom, right, top = self.box
        return right - left, top - bottom

    def growth(self, height: float, stroke: float) -> float:
        """The distance, in mm, by which outlines of a digit height in mm have to move outward for
        strokes of a width in mm; 0 where strokes are as wide."""
        return height * stroke_growth(self.section, stroke / height) if stroke > 0.0 else 0.0

    def cut(self, height: float, growth: float, where: str) -> CrossSection:
        """The section in mm, of a digit height and with outlines moved outward, both in mm.

        Raises EngravingError, which begins with `where`: that closes a hole or joins parts.
        """
        plain = self.section.scale((height, height))
        wider = grown(plain, growth)
        before, after = holes_and_parts(plain), holes_and_parts(wider)
        if before != after:
            raise EngravingError(
                f"{where}: expected {before[0]} holes and {before[1]} parts to stay apart with "
                f"strokes wider by {2.0 * growth:.2f} mm at a digit height of {height:.2f} mm, got "
                f"{after[0]} and {after[1]}; reduce stroke_mm, increase size_mm, or take another "
                "font or a shorter label"
            )
        return wider


def label_arts(text: str, options: EngravingOptions) -> list[LabelArt]:
    """The arts that a label may have by the options: its icon where it has one, else pips or text,
    with a mark where it is another number upside down; text with spaces in one line, in two and so
    on.

    Raises
    ------
    InputError: the font or the icon cannot be read.
    EngravingError: the label cannot be drawn.
    """
    if text in options.icons:
        return [_within_bounds(icon_section(options.icons[text], text))]
    if options.content == "pips":
        return [LabelArt(pips_section(text), (0.0, 0.0, 1.0, 1.0))]
    if reads_upside_down(text):
        return [_within_bounds(marked(text_section(text, options.font), options.ambiguous))]
    broken = line_breaks(text, options.font)
    return [_within_bounds(text_section(lines, options.font)) for lines in broken]


def _within_bounds(section: CrossSection) -> LabelArt:
    left, bottom, right, top = section.bounds()
    return LabelArt(section, (left, bottom, right, top))


def require_art(labels: Iterable[str], options: EngravingOptions) -> None:
    """Raise InputError where the art of a label cannot be made."""
    for label in labels:
        label_arts(label, options)
