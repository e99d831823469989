"""Vectors in 60 decimal digits, for the oracle."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, Final

from dicedesign.errors import InputError

__all__ = [
    "DIGITS",
    "Number",
    "OracleError",
    "Vector",
    "cross",
    "dot",
    "minus",
    "multiprecision",
    "plus",
    "sign",
    "solid_centroid",
    "spherical_excess",
    "times",
    "unit",
    "vector",
]

Number = Any
"""An `mpmath.mpf`; all functions here expect to run within `mpmath.workdps(DIGITS)`."""

Vector = tuple[Number, Number, Number]

DIGITS: Final = 60
"""Decimal digits of all arithmetic."""

ZERO: Final = 1e-40
"""A sum of products below this part of its terms' magnitude counts as zero. No sum that decides
about a body with float64 coordinates is likely to come near it without being zero."""


class OracleError(ArithmeticError):
    """A body has no one answer, as it balances exactly, or its facets are no convex polyhedron."""


def multiprecision() -> ModuleType:
    """The package mpmath. Raises InputError where it is not installed."""
    try:
        import mpmath
    except ImportError as error:
        raise InputError(
            "oracle: expected the package mpmath, which is not installed; "
            "pip install 'dicedesign[bench]' brings it"
        ) from error
    module: ModuleType = mpmath
    return module


def vector(x: Sequence[Any]) -> Vector:
    """Three floats or mpmath numbers as they are, without rounding."""
    mpf = multiprecision().mpf
    return mpf(x[0]), mpf(x[1]), mpf(x[2])


def dot(a: Vector, b: Vector) -> Number:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(factor: Number, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]


def unit(a: Vector) -> Vector:
    length = _length(a)
    return a[0] / length, a[1] / length, a[2] / length


def sign(a: Vector, b: Vector) -> int:
    """Sign of a . b, 1 or -1. Raises OracleError where it is zero."""
    terms = a[0] * b[0], a[1] * b[1], a[2] * b[2]
    value = sum(terms)
    if abs(value) <= ZERO * sum(map(abs, terms)):
        raise OracleError("oracle: expected a sign, got zero; the body balances exactly")
    return 1 if value > 0 else -1


def spherical_excess(k: Vector, a: Vector, b: Vector) -> Number:
    """Signed area of the spherical triangle of unit vectors k, a, b, positive if they turn
    counter-clockwise seen from outside: 2 pi less its outer angles."""
    ka, ab, bk = cross(k, a), cross(a, b), cross(b, k)
    if _length(ab) <= ZERO:
        return multiprecision().mpf(0)
    excess = 2 * multiprecision().pi - _angle(ka, ab) - _angle(ab, bk) - _angle(bk, ka)
    return excess if dot(k, ab) > 0 else -excess


def solid_centroid(vertices: Sequence[Vector], triangles: Sequence[Sequence[int]]) -> Vector:
    """Mean of the centers of the tetrahedra between the first corner and each facet, by volume.

    triangles: corners of each facet, all counter-clockwise from outside or all from inside.
    """
    apex = vertices[0]
    volume, moment = vector((0, 0, 0))[0], vector((0, 0, 0))
    for a, b, c in triangles:
        x, y, z = (minus(vertices[corner], apex) for corner in (a, b, c))
        sixfold = dot(x, cross(y, z))
        volume += sixfold
        moment = plus(moment, times(sixfold / 4, plus(x, plus(y, z))))
    return plus(apex, times(1 / volume, moment))


def _angle(a: Vector, b: Vector) -> Number:
    return multiprecision().atan2(_length(cross(a, b)), dot(a, b))


def _length(a: Vector) -> Number:
    return multiprecision().sqrt(dot(a, a))
