"""Vectors of fractions, for answers without rounding."""

from __future__ import annotations

from fractions import Fraction

Vector = tuple[Fraction, ...]


def minus(a: Vector, b: Vector) -> Vector:
    """(3,) a - b."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def dot(a: Vector, b: Vector) -> Fraction:
    """Inner product."""
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def cross(a: Vector, b: Vector) -> Vector:
    """(3,) vector product."""
    return tuple(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3))
