"""Target distributions of dice."""

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
"""Limit on the outcomes: a die with more cannot be printed and read."""


@dataclass(frozen=True)
class Target:
    """Outcomes with their target probabilities.

    Attributes
    ----------
    labels: (k,) distinct texts.
    probabilities: (k,) positive, summing to 1.
    """

    labels: tuple[str, ...]
    probabilities: Floats


def binomial(flips: int) -> Target:
    """Number of heads among `flips` >= 1 fair coins: labels "0" .. "flips"."""
    _check_counts("binomial", 1, [flips], flips + 1)
    weights = [comb(flips, heads) / 2**flips for heads in range(flips + 1)]
    return Target(_number(0, flips + 1), np.array(weights))


def sum_of_dice(sides: Sequence[int]) -> Target:
    """Total of fair dice with the given numbers of sides, each >= 2 (eq. 22 for [6, 6])."""
    if not sides:
        raise InputError(
            "sum_of_dice: expected at least one number of sides, got none; write [6, 6] for two "
            "dice"
        )
    _check_counts("sum_of_dice", 2, sides, sum(sides) - len(sides) + 1)
    weights = np.ones(1)
    for count in sides:
        weights = np.convolve(weights, np.full(count, 1.0 / count))
    return Target(_number(len(sides), len(weights)), weights / weights.sum())


def fair(outcomes: int) -> Target:
    """`outcomes` >= 2 equally probable outcomes: labels "1" .. "outcomes"."""
    _check_counts("fair", 2, [outcomes], outcomes)
    return Target(_number(1, outcomes), np.full(outcomes, 1.0 / outcomes))


def custom(probabilities: Sequence[float]) -> Target:
    """Any distribution, by its probabilities: labels "1", "2", ...

    Rounded decimals are divided by their sum.

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
    _check_counts("probabilities", 0, [], len(values))
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
    return Target(_number(1, len(values)), values)


def relabel(target: Target, labels: Sequence[str] | None) -> Target:
    """Target with other labels; None keeps the labels. Raises InputError."""
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


def _number(first: int, count: int) -> tuple[str, ...]:
    """Successive whole numbers as labels."""
    return tuple(map(str, range(first, first + count)))


def _check_counts(name: str, least: int, counts: Sequence[int], outcomes: int) -> None:
    """Raise InputError if a count is below the least, or there are too many outcomes."""
    for count in counts:
        if count < least:
            raise InputError(
                f"{name}: expected a whole number of at least {least}, got {count}; raise it"
            )
    if outcomes > MOST_OUTCOMES:
        raise InputError(
            f"{name}: expected at most {MOST_OUTCOMES} outcomes, got {outcomes}; join some"
        )
