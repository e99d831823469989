"""The exception tree, checks of given numbers, and texts of messages.

Every error a user can cause names the thing, what was expected, what came, and the remedy. The
command line prints the message on one line and exits with 2. The design treats an error as the
failure of one trial step, and the pipeline treats labels that do not fit an unfinished die as a
remark.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from typing import TypeGuard

__all__ = [
    "CheckpointError",
    "DegenerateBodyError",
    "DiceError",
    "EngravingError",
    "InputError",
    "LabelRoomError",
    "MeshFileError",
    "NoStartError",
    "OutputError",
    "OutsideHullError",
    "RecipeError",
    "check_whole",
    "is_finite_number",
    "missing_extra",
    "named",
    "printable",
]


class DiceError(Exception):
    """Base of all errors raised on purpose by this package."""


class InputError(DiceError, ValueError):
    """An input cannot be used; the message says what to give instead."""


class CheckpointError(InputError):
    """A checkpoint is of other work, or the work keeps none."""


class MeshFileError(InputError):
    """A mesh or point file is missing, unreadable or empty."""


class DegenerateBodyError(InputError):
    """The points span no volume: too few, coplanar, collinear, not finite, or zero volume."""


class OutsideHullError(InputError):
    """The center of mass is not strictly inside the convex hull."""


class NoStartError(InputError):
    """No starting shape has one rest for each outcome and no other.

    Remove the extra rests of the start, use `method: paper`, or take another start.
    """


class RecipeError(InputError):
    """A recipe has an unknown key, a wrong type or an impossible value."""


class EngravingError(InputError):
    """A label does not fit its facet, or the engraved solid failed a check."""


class LabelRoomError(EngravingError):
    """A label is too small to read on a die of this size.

    Attributes
    ----------
    size_mm: largest distance between two vertices at which all labels of the die fit.
    """

    def __init__(self, message: str, size_mm: float) -> None:
        super().__init__(message)
        self.size_mm = size_mm


class OutputError(DiceError, OSError):
    """A result cannot be written to its path."""


@contextmanager
def named(key: str) -> Iterator[None]:
    """Prefix messages of InputError with the option or recipe key that the input came from."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{key}: {error}") from error


def missing_extra(extra: str, wanted: str, error: ImportError) -> InputError:
    """Error about a missing extra of this package that something wanted needs."""
    return InputError(
        f"{wanted}: expected the optional extra {extra!r}, but {error}; "
        f"pip install 'dicedesign[{extra}]'"
    )


MOST_COUNT = 10**9
"""Largest count of anything."""

MOST_SEED = 2**96
"""Upper bound of seeds. Recipes have seeds below 2^64, and derive one for each series of throws."""


def check_whole(name: str, value: int, least: int = 1, most: int = MOST_COUNT) -> None:
    """Raise InputError, with the name of a number, if it is out of a range."""
    if value < least:
        wanted = "above 0" if least == 1 else f"of at least {least}"
        raise InputError(f"{name}: expected a whole number {wanted}, got {value}; raise it")
    if value > most:
        raise InputError(f"{name}: expected a whole number up to {most}, got {value}; lower it")


def is_finite_number(value: object) -> TypeGuard[float]:
    """Whether something is a finite real number, and not True or False."""
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def printable(text: object) -> str:
    """A text or path as one line of UTF-8; characters that cannot be printed become Python
    escapes."""
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in str(text))
