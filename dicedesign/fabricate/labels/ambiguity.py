"""Numbers that are others when they are turned by 180 degrees, and what marks them."""

from __future__ import annotations

from typing import Final

from manifold3d import CrossSection

__all__ = ["marked", "reads_upside_down"]

BAR_GAP: Final = 0.16
"""Distance from the baseline down to the bar of an ambiguous label, in digit heights."""

BAR_THICKNESS: Final = 0.16
"""Thickness of that bar, in digit heights."""

DOT_GAP: Final = 0.14
"""Distance from an ambiguous label to the dot after it, in digit heights."""

DOT_DIAMETER: Final = 0.24
"""Of that dot, in digit heights."""

DOT_CORNERS: Final = 32

TURNED: Final = {"0": "0", "1": "1", "6": "9", "8": "8", "9": "6"}
"""Digits that are digits when they are turned by 180 degrees, and which."""


def reads_upside_down(text: str) -> bool:
    """True if the text, turned by 180 degrees, reads as a different number ("6", "16", "68").

    Turned texts that start with a zero ("10" gives "01") are no numbers and do not count.
    """
    if not text or not set(text) <= set(TURNED):
        return False
    turned = "".join(TURNED[digit] for digit in reversed(text))
    return turned != text and (len(turned) == 1 or turned[0] != "0")


def marked(section: CrossSection, mark: str) -> CrossSection:
    """A number with a bar beneath that is as wide ("bar"), or a dot on the baseline after it
    ("dot"), or neither ("none").

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
