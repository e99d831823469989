"""Checks of numbers that people give, with one wording."""

from __future__ import annotations

import math
from numbers import Real
from typing import Final, TypeGuard

from dicedesign.errors import InputError

MOST: Final = 10**9
"""More of anything takes longer than anybody waits."""

MOST_SEED: Final = 2**96
"""Recipes have seeds below 2^64; each of their series of throws has one of its own."""


def check_whole(name: str, value: int, least: int = 1, most: int = MOST) -> None:
    """Raise InputError, naming what the number is, where it is out of the range that is allowed."""
    if value < least:
        wanted = "above 0" if least == 1 else f"of at least {least}"
        raise InputError(f"{name}: expected a whole number {wanted}, got {value}; raise it")
    if value > most:
        raise InputError(f"{name}: expected a whole number up to {most}, got {value}; lower it")


def is_finite_number(value: object) -> TypeGuard[float]:
    """Whether something is a finite real number, and not True or False."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
