"""Vectors of fractions or integers, for answers without rounding."""

from __future__ import annotations

from fractions import Fraction
from typing import TypeVar

Number = TypeVar("Number", int, Fraction)

Vector = tuple[Fraction, ...]


def minus(a: tuple[Number, ...], b: tuple[Number, ...]) -> tuple[Number, ...]:
    """(3,) a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: tuple[Number, ...], b: tuple[Number, ...]) -> Number:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: tuple[Number, ...], b: tuple[Number, ...]) -> tuple[Number, ...]:
    """(3,) vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
