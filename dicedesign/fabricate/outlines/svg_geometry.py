"""Outlines of the shapes of SVG as path data, and its transforms.

Lengths are in the user unit of the picture; y is downward.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from dicedesign.runtime.arrays import Floats

__all__ = ["OUTLINES", "transform"]

LARGEST: Final = 1e6
"""Entry of a transform."""

MOST_CHARACTERS: Final = 2000
"""Of a transform, and of numbers in an arc that nothing separates."""

MOST_CALLS: Final = 100
"""In a transform."""


def _length(element: Any, name: str, default: float = 0.0) -> float:
    text = element.get(name)
    value = default if text is None else float(text.strip().removesuffix("px"))
    if not math.isfinite(value):
        raise ValueError(f"{name}={text!r}")
    return value


def _ellipse(element: Any, rx: float, ry: float) -> str:
    x, y = _length(element, "cx"), _length(element, "cy")
    if not (rx > 0.0 and ry > 0.0):
        return ""
    half = f"A{rx!r},{ry!r} 0 0 1"
    return f"M{x - rx!r},{y!r} {half} {x + rx!r},{y!r} {half} {x - rx!r},{y!r} Z"


def _rectangle(element: Any) -> str:
    x, y = _length(element, "x"), _length(element, "y")
    width, height = _length(element, "width"), _length(element, "height")
    if not (width > 0.0 and height > 0.0):
        return ""
    rx = _length(element, "rx", _length(element, "ry"))
    ry = _length(element, "ry", rx)
    rx, ry = min(max(rx, 0.0), 0.5 * width), min(max(ry, 0.0), 0.5 * height)
    right, bottom = x + width, y + height
    if rx == 0.0 or ry == 0.0:
        return f"M{x!r},{y!r} H{right!r} V{bottom!r} H{x!r} Z"
    arc = f"A{rx!r},{ry!r} 0 0 1"
    return (
        f"M{x + rx!r},{y!r} H{right - rx!r} {arc} {right!r},{y + ry!r} V{bottom - ry!r} "
        f"{arc} {right - rx!r},{bottom!r} H{x + rx!r} {arc} {x!r},{bottom - ry!r} "
        f"V{y + ry!r} {arc} {x + rx!r},{y!r} Z"
    )


_ARC: Final = re.compile(r"[Aa]([^MmZzLlHhVvCcSsQqTtAa]*)")


def _path(element: Any) -> str:
    """Path data; the time to parse arcs rises with the square of what is not separated in them."""
    data = element.get("d") or ""
    for arc in _ARC.finditer(data):
        if max(map(len, re.split(r"[, \t]", arc[1]))) > MOST_CHARACTERS:
            raise ValueError(f"an arc with more than {MOST_CHARACTERS} characters in a row")
    return data


OUTLINES: Final[dict[str, Callable[[Any], str]]] = {
    "path": _path,
    "rect": _rectangle,
    "circle": lambda e: _ellipse(e, _length(e, "r"), _length(e, "r")),
    "ellipse": lambda e: _ellipse(e, _length(e, "rx"), _length(e, "ry")),
    "polygon": lambda e: f"M{e.get('points')}Z" if (e.get("points") or "").strip() else "",
    "polyline": lambda e: f"M{e.get('points')}Z" if (e.get("points") or "").strip() else "",
    "line": lambda e: "",
}
"""Outlines of shapes, as a path attribute has them."""


def _rotation(degrees: float, x: float = 0.0, y: float = 0.0) -> Floats:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    there, back = _translation(x, y), _translation(-x, -y)
    turn: Floats = there @ np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)]) @ back
    return turn


def _translation(x: float, y: float = 0.0) -> Floats:
    return np.array([(1.0, 0.0, x), (0.0, 1.0, y), (0.0, 0.0, 1.0)])


_TRANSFORMS: Final[dict[str, Callable[..., Floats]]] = {
    "matrix": lambda a, b, c, d, e, f: np.array([(a, c, e), (b, d, f), (0.0, 0.0, 1.0)]),
    "translate": _translation,
    "scale": lambda x, y=None: np.diag([x, x if y is None else y, 1.0]),
    "rotate": _rotation,
    "skewX": lambda a: np.array([(1.0, math.tan(math.radians(a)), 0.0), (0, 1, 0), (0, 0, 1)]),
    "skewY": lambda a: np.array([(1.0, 0, 0), (math.tan(math.radians(a)), 1, 0), (0, 0, 1)]),
}

_CALL: Final = re.compile(r"(\w+)\s*\(([^()]*)\)[\s,]*")


def transform(text: str) -> Floats:
    """Matrix (3, 3) of a transform attribute, such as "translate(3 4) rotate(30)".

    Raises ValueError: it cannot be read, has more than `MOST_CHARACTERS` or `MOST_CALLS`, or has
    entries that are not finite or above `LARGEST`.
    """
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f"more than {MOST_CHARACTERS} characters")
    text = text.strip()
    matrix, position = np.eye(3), 0
    for _ in range(MOST_CALLS):
        if position == len(text):
            return matrix
        call = _CALL.match(text, position)
        if call is None:
            raise ValueError(repr(text[:60]))
        try:
            numbers = [float(value) for value in re.split(r"[\s,]+", call[2].strip())]
            step = _TRANSFORMS[call[1]](*numbers)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(repr(text[:60])) from error
        _check_size(step, text)
        matrix = matrix @ step
        _check_size(matrix, text)
        position = call.end()
    if position < len(text):
        raise ValueError(f"more than {MOST_CALLS} in a row")
    return matrix


def _check_size(matrix: Floats, text: str) -> None:
    if not (np.isfinite(matrix).all() and np.abs(matrix).max() <= LARGEST):
        raise ValueError(repr(text[:60]))
