"""Vectors as command-line options."""

from __future__ import annotations

import math

from dicedesign.errors import InputError

__all__ = ["numbers", "vector"]

WORDS = {3: "three", 6: "six"}


def numbers(option: str, text: str, form: str) -> list[float]:
    """The finite numbers of a text such as "x,y,z", which is its form. Raises InputError naming the
    option."""
    count = form.count(",") + 1
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        raise InputError(f"{option}: expected {WORDS[count]} numbers {form}, got {text!r}")
    return found


def vector(option: str, text: str) -> tuple[float, float, float]:
    """The three finite numbers of "x,y,z". Raises InputError naming the option."""
    x, y, z = numbers(option, text, "x,y,z")
    return x, y, z
