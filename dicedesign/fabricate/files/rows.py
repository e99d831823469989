"""Rows of numbers as text."""

from __future__ import annotations

from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["rows"]


def rows(form: str, values: Floats | Integers) -> str:
    """A text for each row (n, k) of numbers, with all their digits.

    form: such as "v {!r} {!r} {!r}\\n", with a place for each of the k numbers.
    """
    return "".join(form.format(*row) for row in values.tolist())
