"""Dice to begin with: a name, the odds as they are typed, and labels where they need some."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["PRESETS", "Preset"]


@dataclass(frozen=True)
class Preset:
    """What goes into the fields of a new die; empty labels are those of the odds."""

    odds: str
    labels: str = ""


PRESETS: Final = {
    "Two dice in one (2d6)": Preset("sum_of_dice: [6, 6]"),
    "Two small dice in one (2d4)": Preset("sum_of_dice: [4, 4]"),
    "Fair, 3 sides": Preset("fair: 3"),
    "Fair, 5 sides": Preset("fair: 5"),
    "Fair, 7 sides": Preset("fair: 7"),
    "Heads of 4 coins (binomial)": Preset("binomial: 4"),
    "A coin that can stand": Preset("1/2, 1/3, 1/6", "heads, tails, edge"),
    "Loaded: 6 twice as often": Preset("1/7, 1/7, 1/7, 1/7, 1/7, 2/7"),
    "Yes, no, perhaps": Preset("0.45, 0.45, 0.1", "yes, no, perhaps"),
}
"""By what the page calls them."""
