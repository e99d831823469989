"""Colours and opacities of SVG."""

from __future__ import annotations

import math
from functools import cache
from typing import Final

__all__ = ["is_zero", "luminance"]

INVISIBLE: Final = ("none", "transparent")

MOST_CHARACTERS: Final = 100
"""Of a colour."""

WEIGHTS: Final = (0.2126, 0.7152, 0.0722)
"""Of red, green and blue in luminance, ITU-R BT.709."""


@cache
def luminance(colour: str) -> float | None:
    """Of a colour of CSS, in [0, 1]: a name, #rgb, #rrggbb, rgb(), or currentColor, which is 0.
    None where it shows nothing.

    Raises ValueError, with the colour quoted: it is none of these, such as the url() of a gradient.
    """
    plain = colour.strip().lower()
    if plain in INVISIBLE:
        return None
    if plain == "currentcolor":
        return 0.0
    try:
        red, green, blue, alpha = _channels(plain)
    except ValueError as error:
        raise ValueError(repr(colour[:60])) from error
    if alpha == 0.0:
        return None
    return sum(w * c for w, c in zip(WEIGHTS, (red, green, blue), strict=True)) / 255.0


def is_zero(opacity: str) -> bool:
    """Whether an opacity, a number or a percentage, is 0 or below.

    Raises ValueError, with the opacity quoted: it is no number.
    """
    try:
        return _number(opacity, 1.0) <= 0.0
    except ValueError as error:
        raise ValueError(repr(opacity[:60])) from error


def _channels(colour: str) -> tuple[float, float, float, float]:
    """Red, green, blue and opacity, in [0, 255]."""
    if len(colour) > MOST_CHARACTERS:
        raise ValueError(colour)
    function, bracket, inner = colour.partition("(")
    if bracket and function in ("rgb", "rgba"):
        if not inner.endswith(")"):
            raise ValueError(colour)
        red, green, blue, *rest = inner[:-1].replace(",", " ").replace("/", " ").split()
        if len(rest) > 1:
            raise ValueError(colour)
        parts = [_number(part, 255.0) for part in (red, green, blue)]
        parts += [255.0 * _number(part, 1.0) for part in rest or ["1"]]
    else:
        from PIL import ImageColor

        parts = [float(part) for part in (*ImageColor.getrgb(colour), 255)[:4]]
    red_, green_, blue_, alpha = (min(max(part, 0.0), 255.0) for part in parts)
    return red_, green_, blue_, alpha


def _number(text: str, whole: float) -> float:
    """A number, or a percentage of a whole; finite."""
    text = text.strip()
    number = float(text.removesuffix("%")) * (whole / 100.0 if text.endswith("%") else 1.0)
    if not math.isfinite(number):
        raise ValueError(text)
    return number
