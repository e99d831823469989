"""Vectors as command-line options."""

from __future__ import annotations

import math

from dicedesign.errors import InputError

__all__ = ["vector"]


def vector(option: str, text: str) -> tuple[float, float, float]:
    """The three finite numbers of "x,y,z". Raises InputError naming the option."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{option}: expected three numbers x,y,z, got {text!r}")
    return x, y, z
