"""Numbers of a throw that may differ from one throw to the next."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias, TypeGuard

from dicedesign.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from dicedesign.runtime.arrays import Floats

__all__ = [
    "Limits",
    "Spread",
    "checked_number",
    "checked_spread",
    "drawn",
    "least_of",
    "mean_of",
    "most_of",
    "scaled",
]

Spread: TypeAlias = float | tuple[float, float]
"""A number, the same in every throw; or the least and the most, between which each throw has one,
all equally likely and independent of everything else."""

Limits: TypeAlias = tuple[float, float, str]
"""Of a number: the least, the most, and both in words."""


def least_of(spread: Spread) -> float:
    """The least value of any throw."""
    return spread[0] if isinstance(spread, tuple) else spread


def most_of(spread: Spread) -> float:
    """The largest value of any throw."""
    return spread[1] if isinstance(spread, tuple) else spread


def mean_of(spread: Spread) -> float:
    """The mean of all throws."""
    return (spread[0] + spread[1]) / 2.0 if isinstance(spread, tuple) else spread


def scaled(spread: Spread, factor: float) -> Spread:
    """Every value times a number above 0."""
    if isinstance(spread, tuple):
        return factor * spread[0], factor * spread[1]
    return factor * spread


def drawn(spread: Spread, count: int, rng: np.random.Generator) -> float | Floats:
    """The values (count,) of so many throws, or the number that all have, for which nothing is
    drawn."""
    if not isinstance(spread, tuple):
        return spread
    values: Floats = rng.uniform(spread[0], spread[1], count)
    return values


def checked_number(value: object, owner: str, name: str, limits: Limits) -> float:
    """A number within its limits.

    owner: whose it is, and name: what it is, in words.

    Raises InputError: it is none, or beyond them.
    """
    if not _is_number(value):
        raise InputError(f"{owner}: expected a number as {name}, got {value!r}; correct it")
    least, most, words = limits
    if not least <= value <= most:
        raise InputError(f"{owner}: expected a {name} of {words}, got {value}; correct it")
    return value


def checked_spread(value: object, owner: str, name: str, limits: Limits) -> Spread:
    """A number, or a range as list or tuple, within its limits.

    Parameters: as of `checked_number`.

    Raises InputError: it is neither, beyond the limits, or a range that is reversed or empty.
    """
    if _is_number(value):
        return checked_number(value, owner, name, limits)
    if not isinstance(value, list | tuple) or len(value) != 2 or not all(map(_is_number, value)):
        raise InputError(
            f"{owner}: expected a number or a range [least, most] as {name}, got {value!r}; "
            "correct it"
        )
    low, high = (checked_number(end, owner, name, limits) for end in value)
    if low >= high:
        raise InputError(
            f"{owner}: expected a range of {name} from less to more, got [{low}, {high}]; "
            + ("turn it round" if low > high else "give the number alone")
        )
    return low, high


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
