"""Colors of figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from dicedesign.runtime.arrays import Floats

DARK: Final = "#1f2933"
"""Separatrices, axes and text."""

ACCENT: Final = "#c2571a"
"""What was achieved."""

PALE: Final = "#9fb3c8"
"""What was asked for."""

FAINT: Final = "#7b8794"
"""Hull arcs and reference lines."""

GRID: Final = "#dee1e4"
"""Lines of a grid."""

DISTINCT: Final = (
    "#d55e00",
    "#0072b2",
    "#009e73",
    "#cc79a7",
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#8c8c8c",
)
"""Line colors that the color-blind tell apart. Source: M. Okabe and K. Ito, Color Universal
Design (2008), whose yellow, hard to see on white, is gray here."""

BASINS: Final = (
    "#7fb2de",
    "#f5b26b",
    "#86cf94",
    "#e58a8a",
    "#b9a0dc",
    "#f2dd6e",
    "#6fcfcb",
    "#eaa3cf",
    "#b5b08a",
    "#a9c94c",
    "#c79a74",
    "#c3ccd6",
    "#4f8fc0",
    "#d98324",
    "#4fa865",
    "#c25b5b",
    "#8b6fc0",
    "#c9ad1f",
    "#33a09b",
    "#c46aa3",
)
"""Colors of basins, the most probable first; they repeat after twenty."""

LOW_TO_HIGH: Final = ("#2a1a52", "#31508f", "#2a8c8c", "#7fbf5a", "#f4e67a")
"""Of a quantity, at equal steps; ever lighter, so that it can be told without colors too."""


def repeat(colors: Sequence[str], count: int) -> list[str]:
    """`count` colors, from the first again after the last."""
    return [colors[k % len(colors)] for k in range(count)]


def rgb(colors: Sequence[str]) -> Floats:
    """(k, 3) red, green and blue from 0 to 1 of colors as "#rrggbb"."""
    return np.array([[int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for color in colors])
