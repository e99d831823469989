"""Distributions a die is asked to have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, isfinite
from typing import Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import PROBABILITY_SUM_TOLERANCE

MOST_OUTCOMES: Final = 200
"""More faces than anybody can print and read."""


@dataclass(frozen=True)
class Target:
    """Outcomes with their wanted probabilities.

    Attributes
    ----------
    labels: (k,) distinct texts.
    probabilities: (k,) positive, summing to 1.
    """

    labels: tuple[str, ...]
    probabilities: Floats


def binomial(flips: int) -> Target:
    """Number of heads among `flips` >= 1 fair coins: labels "0" .. "flips"."""
    _at_least("binomial", flips, 1)
    _at_most("binomial", flips + 1)
    weights = [comb(flips, heads) / 2**flips for heads in range(flips + 1)]
    return Target(tuple(str(heads) for heads in range(flips + 1)), np.array(weights))


def sum_of_dice(sides: Sequence[int]) -> Target:
    """Total of fair dice with the given numbers of sides, each >= 2 (eq. 22 for [6, 6])."""
    if not sides:
        raise InputError(
            "sum_of_dice: expected at least one number of sides, got none; write [6, 6] for two "
            "dice"
        )
    for count in sides:
        _at_least("sum_of_dice", count, 2)
    _at_most("sum_of_dice", sum(sides) - len(sides) + 1)
    weights = np.ones(1)
    for count in sides:
        weights = np.convolve(weights, np.full(count, 1.0 / count))
    first = len(sides)
    return Target(tuple(str(first + i) for i in range(len(weights))), weights / weights.sum())


def fair(outcomes: int) -> Target:
    """`outcomes` >= 2 equally probable outcomes: labels "1" .. "outcomes"."""
    _at_least("fair", outcomes, 2)
    _at_most("fair", outcomes)
    labels = tuple(str(i + 1) for i in range(outcomes))
    return Target(labels, np.full(outcomes, 1.0 / outcomes))


def custom(probabilities: Sequence[float]) -> Target:
    """Any distribution, given by its probabilities: labels "1", "2", ...

    Decimals that were cut off, whose sum is not 1 to rounding, are divided by it.

    Raises
    ------
    InputError: fewer than two outcomes, a probability not in (0, 1), or a sum other than 1.
    """
    values = np.asarray(probabilities, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2:
        raise InputError(
            f"probabilities: expected at least two, got {list(probabilities)!r}; write one for "
            "each outcome"
        )
    _at_most("probabilities", len(values))
    for value in values:
        if not isfinite(value) or not 0.0 < value < 1.0:
            raise InputError(
                f"probabilities: expected numbers between 0 and 1, got {value:g}; leave out "
                "outcomes that never happen"
            )
    if abs(float(values.sum()) - 1.0) > PROBABILITY_SUM_TOLERANCE:
        raise InputError(
            f"probabilities: expected a sum of 1, got {values.sum():.12g}; write fractions such as "
            "1/3 where decimals do not suffice"
        )
    if abs(float(values.sum()) - 1.0) > len(values) * np.finfo(np.float64).eps:
        values = values / values.sum()
    return Target(tuple(str(i + 1) for i in range(len(values))), values)


def relabel(target: Target, labels: Sequence[str] | None) -> Target:
    """Target with other labels; None keeps its own. Raises InputError."""
    if labels is None:
        return target
    texts = tuple(str(label) for label in labels)
    if len(texts) != len(target.probabilities):
        raise InputError(
            f"labels: expected {len(target.probabilities)}, one for each outcome, got "
            f"{len(texts)}; add or remove some"
        )
    if len(set(texts)) != len(texts):
        twice = next(text for text in texts if texts.count(text) > 1)
        raise InputError(
            f"labels: expected distinct labels, got {twice!r} more than once; rename one"
        )
    return Target(texts, target.probabilities)


def _at_least(name: str, value: int, smallest: int) -> None:
    if value < smallest:
        raise InputError(
            f"{name}: expected a whole number of at least {smallest}, got {value}; raise it"
        )


def _at_most(name: str, outcomes: int) -> None:
    if outcomes > MOST_OUTCOMES:
        raise InputError(
            f"{name}: expected at most {MOST_OUTCOMES} outcomes, got {outcomes}; join some"
        )
