"""Colors of figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dicedesign.runtime.arrays import Floats

DARK = "#1f2933"
"""Separatrices, axes and text."""

ACCENT = "#c2571a"
"""Achieved values."""

PALE = "#9fb3c8"
"""Target values."""

FAINT = "#7b8794"
"""Hull arcs and reference lines."""

GRID = "#dee1e4"
"""Lines of a grid."""

DISTINCT = (
    "#d55e00",
    "#0072b2",
    "#009e73",
    "#cc79a7",
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#8c8c8c",
)
"""Line colors that color-blind people can distinguish. Source: M. Okabe and K. Ito, Color Universal
Design (2008); gray replaces yellow, which is hard to see on white."""

BASINS = (
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
"""Colors of basins, the most probable basin first; they repeat after twenty."""


def repeat(colors: Sequence[str], count: int) -> list[str]:
    """Cycle through colors, `count` in all."""
    return [colors[k % len(colors)] for k in range(count)]


def rgb(colors: Sequence[str]) -> Floats:
    """Red, green and blue (k, 3) from 0 to 1 of colors such as "#c2571a"."""
    return np.array([[int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for color in colors])
