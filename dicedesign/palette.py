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

FEW_OUTCOMES = ("#3B86DB", "#F3AE3D", "#B8497F", "#5CCBA8", "#8A5A2B")
"""Colors of up to five outcomes, far apart for each kind of color blindness."""

OUTCOME_RAMP = (
    "#5E589F",
    "#4C6CB6",
    "#2D8ACB",
    "#0098C6",
    "#00ADBE",
    "#00BEAE",
    "#41CC9A",
    "#84D587",
    "#B9DB7A",
    "#E5DE7C",
    "#FFE390",
)
"""Colors of more outcomes, from dark to light; a label always accompanies them."""

BLANK = "#d8d3c8"
"""Bodies of dice: facets without an outcome, and rounded edges."""

INK = "#14171a"
"""Text on light colors, and labels."""

MIN_CONTRAST = 4.5
"""Contrast of text. Source: Web Content Accessibility Guidelines 2.2, criterion 1.4.3."""


def outcome_colors(count: int) -> list[str]:
    """Colors of `count` outcomes in their order, the same on the page, in figures and in files."""
    if count <= len(FEW_OUTCOMES):
        return list(FEW_OUTCOMES[:count])
    places = np.linspace(0.0, len(OUTCOME_RAMP) - 1, count)
    ramp = rgb(OUTCOME_RAMP)
    mixed = np.stack([np.interp(places, range(len(ramp)), channel) for channel in ramp.T], axis=1)
    return ["#" + bytes(color).hex() for color in np.rint(255.0 * mixed).astype(np.uint8)]


def text_color(background: str) -> str:
    """Ink, white or black on a background color: the first that reaches `MIN_CONTRAST`."""
    return next(
        color
        for color in (INK, "#ffffff", "#000000")
        if contrast(color, background) >= MIN_CONTRAST
    )


def contrast(a: str, b: str) -> float:
    """Contrast of two colors, from 1 to 21. Source: Web Content Accessibility Guidelines 2.2."""
    light, dark = sorted((luminance(a), luminance(b)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def luminance(color: str) -> float:
    """Relative luminance from 0 to 1. Source: Web Content Accessibility Guidelines 2.2."""
    channels = rgb([color])[0]
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def rgb(colors: Sequence[str]) -> Floats:
    """Red, green and blue (k, 3) from 0 to 1 of colors such as "#c2571a"."""
    return np.array([[int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for color in colors])
