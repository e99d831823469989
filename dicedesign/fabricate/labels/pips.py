"""Numbers as pips, in the patterns of ordinary dice.

Lengths are in digit heights: the patterns of all numbers fill the same square of side 1.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from manifold3d import CrossSection, OpType

from dicedesign.errors import EngravingError
from dicedesign.fabricate.outlines.flattening import CHORD_TOLERANCE
from dicedesign.runtime.arrays import Floats

__all__ = ["MOST_PIPS", "pip_places", "pips_section"]

FULLNESS: Final = 0.64
"""Diameter of a pip over the distance to the next."""

PATTERNS: Final = {
    1: ("...", ".x.", "..."),
    2: ("..x", "...", "x.."),
    3: ("..x", ".x.", "x.."),
    4: ("x.x", "...", "x.x"),
    5: ("x.x", ".x.", "x.x"),
    6: ("x.x", "x.x", "x.x"),
    7: ("x.x", "xxx", "x.x"),
    8: ("xxx", "x.x", "xxx"),
    9: ("xxx", "xxx", "xxx"),
}
"""Rows of a square grid from the top, with a pip where there is an x."""

ROWS: Final = {
    10: (3, 4, 3),
    11: (4, 3, 4),
    12: (4, 4, 4),
    13: (3, 2, 3, 2, 3),
    14: (3, 4, 4, 3),
    15: (3, 3, 3, 3, 3),
    16: (4, 4, 4, 4),
    17: (3, 4, 3, 4, 3),
    18: (4, 3, 4, 3, 4),
    19: (4, 4, 3, 4, 4),
    20: (4, 4, 4, 4, 4),
}
"""Pips in each row, from the top, of numbers without a usual pattern; rows are centred."""

MOST_PIPS: Final = max(ROWS)


def pip_places(number: int) -> tuple[Floats, float]:
    """Middles (n, 2) of the pips of a number from 1 to `MOST_PIPS`, in the unit square, and the
    diameter of each."""
    if number in PATTERNS:
        places: list[tuple[float, float]] = [
            (column, -row)
            for row, signs in enumerate(PATTERNS[number])
            for column, sign in enumerate(signs)
            if sign == "x"
        ]
        steps, middle = 2, np.array([1.0, -1.0])
    else:
        counts = ROWS[number]
        places = [
            (column - 0.5 * (count - 1), -row)
            for row, count in enumerate(counts)
            for column in range(count)
        ]
        steps = max(len(counts), *counts) - 1
        middle = np.array([0.0, -0.5 * (len(counts) - 1)])
    spacing = 1.0 / (steps + FULLNESS)
    return 0.5 + spacing * (np.array(places, dtype=np.float64) - middle), FULLNESS * spacing


def pips_section(text: str) -> CrossSection:
    """Plane section of a number as pips, in the unit square.

    Raises EngravingError: the text is no whole number from 1 to `MOST_PIPS`.
    """
    number = int(text) if text.isascii() and text.isdigit() else 0
    if not 1 <= number <= MOST_PIPS:
        raise EngravingError(
            f"label {text!r}: expected a whole number from 1 to {MOST_PIPS} to show as pips, got "
            "another label; write engrave.content: text, or give it one of engrave.icons"
        )
    places, diameter = pip_places(number)
    radius = 0.5 * diameter
    # So many that the polygon is within the tolerance of the circle.
    corners = int(np.ceil(np.pi / np.sqrt(2.0 * CHORD_TOLERANCE / radius)))
    corners += -corners % 8
    disc = CrossSection.circle(radius, corners)
    return CrossSection.batch_boolean([disc.translate((x, y)) for x, y in places], OpType.Add)
