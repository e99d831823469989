"""Target distributions of dice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import comb, isfinite

import numpy as np

from dicedesign.errors import InputError
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import EQUAL_PROBABILITIES, PROBABILITY_SUM_TOLERANCE

MOST_FACES = 200
"""Limit on the labeled faces: a die with more cannot be printed and read."""

ROUNDED_PERCENTS = 100.0 * PROBABILITY_SUM_TOLERANCE
"""Largest error of the sum of percentages."""


@dataclass(frozen=True)
class Target:
    """Labeled faces with their target probabilities. All faces with one label are one outcome.

    Attributes
    ----------
    face_labels: (f,) texts.
    face_probabilities: (f,) positive, summing to 1. Of an outcome of several faces only the sum is
        wanted, unless the shares are kept.
    keeps_shares: whether each face is to have its own probability.
    """

    face_labels: tuple[str, ...]
    face_probabilities: Floats
    keeps_shares: bool = False

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """(k,) distinct labels of the outcomes, in the order of their first faces."""
        return tuple(dict.fromkeys(self.face_labels))

    @cached_property
    def outcome_of_face(self) -> Integers:
        """(f,) number of the outcome that each face shows."""
        return np.array([self.labels.index(label) for label in self.face_labels])

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) of the outcomes."""
        if not self.has_repeated_labels:
            return self.face_probabilities
        return np.asarray(np.bincount(self.outcome_of_face, self.face_probabilities), np.float64)

    @property
    def wanted(self) -> tuple[Floats, Integers | None]:
        """Probabilities that a design is to have, and the outcome of each face: (k,) and (f,) if
        faces share freely; (f,) and None if each face has a probability of its own."""
        if self.keeps_shares or not self.has_repeated_labels:
            return self.face_probabilities, None
        return self.probabilities, self.outcome_of_face

    def sums(self, values: Floats) -> Floats:
        """(k,) sums of values (f,) over the faces of each outcome; values (k,) stay."""
        if len(values) == len(self.labels):
            return values
        return np.asarray(np.bincount(self.outcome_of_face, values), np.float64)

    @property
    def is_numbered(self) -> bool:
        """Whether consecutive whole numbers are on equally many, equally probable faces."""
        if not all(label.isascii() and label.isdigit() for label in self.labels):
            return False
        numbers, faces = sorted(map(int, self.labels)), np.bincount(self.outcome_of_face)
        probabilities = self.face_probabilities
        is_fair = np.ptp(probabilities) <= EQUAL_PROBABILITIES * probabilities.max()
        return bool(is_fair and np.ptp(faces) == 0 and set(np.diff(numbers).tolist()) == {1})

    @property
    def has_repeated_labels(self) -> bool:
        """Whether an outcome has several faces."""
        return len(self.labels) < len(self.face_labels)


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
    total = float(values.sum())
    is_whole = bool((values == np.round(values)).all())
    if values.min() > 0.0 and (99.0 < total < 101.0 or (1.0 < total < np.inf and is_whole)):
        texts = [f"{value:g}" for value in values]
        percents = f"{'%,'.join(texts)}% or " if abs(total - 100.0) < ROUNDED_PERCENTS else ""
        raise InputError(
            f"probabilities: expected a sum of 1, got {total:g}; did you mean "
            f"{percents}{':'.join(texts)}?"
        )
    for value in values:
        if not isfinite(value) or not 0.0 < value < 1.0:
            raise InputError(
                f"probabilities: expected numbers between 0 and 1, got {value:g}; leave out "
                "outcomes that never happen"
            )
    if abs(total - 1.0) > PROBABILITY_SUM_TOLERANCE:
        raise InputError(
            f"probabilities: expected a sum of 1, got {total:.12g}; write fractions such as "
            "1/3 where decimals do not suffice"
        )
    if abs(total - 1.0) > len(values) * np.finfo(np.float64).eps:
        values = values / total
    return Target(_number(1, len(values)), values)


def several_faces(
    labels: Sequence[str], probabilities: Sequence[float], faces: Sequence[int]
) -> Target:
    """Outcomes with several faces each, which share the outcome's probability in equal parts.

    labels, probabilities, faces: (k,) of the outcomes; for the probabilities see `custom`.

    Raises
    ------
    InputError: labels that are not distinct, a number of faces below 1, or as `custom`.
    """
    shares = custom(probabilities).probabilities
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if list(labels).count(label) > 1)
        raise InputError(
            f"outcomes: expected distinct labels, got {twice!r} more than once; join them, with "
            "the number of faces of all"
        )
    _check_counts("faces", 1, faces, sum(faces))
    texts = tuple(np.repeat(np.array(labels, dtype=object), faces).tolist())
    return Target(texts, np.repeat(shares / np.array(faces), faces))


def equal_faces(target: Target, faces: int) -> Target:
    """Target with each outcome on its part of the equally probable faces. faces: number of all.

    Raises InputError: a part is not a whole number of faces, or an outcome has several faces
    already.
    """
    if target.has_repeated_labels:
        raise InputError(
            f"faces: expected different labels, one for each outcome, got "
            f"{len(target.face_labels)} for {len(target.labels)} outcomes; leave out target.faces, "
            "or join outcomes"
        )
    if not len(target.labels) <= faces <= MOST_FACES:
        raise InputError(
            f"faces: expected {len(target.labels)} to {MOST_FACES}, got {faces}; take another "
            "number, or leave it out"
        )

    def parts(faces: int) -> Integers | None:
        """Faces of each outcome, if these are whole numbers."""
        exact = target.probabilities * faces
        whole = np.round(exact).astype(np.int64)
        is_close = np.abs(exact - whole).max() < PROBABILITY_SUM_TOLERANCE * faces
        return whole if is_close and whole.min() > 0 else None

    counts = parts(faces)
    if counts is None:
        fits = (n for n in range(1, MOST_FACES + 1) if parts(n) is not None)
        least = next(fits, None)
        raise InputError(
            f"faces: expected a number of which every outcome has a whole part, got {faces}; "
            + (f"take a multiple of {least}" if least else f"leave it out: none to {MOST_FACES} is")
        )
    labels = np.repeat(np.array(target.labels, dtype=object), counts)
    return Target(tuple(labels.tolist()), np.full(faces, 1.0 / faces), keeps_shares=True)


def relabel(target: Target, labels: Sequence[str] | None) -> Target:
    """Target with other labels for its faces; None keeps the labels. Faces with the same label
    become one outcome. Raises InputError."""
    if labels is None:
        return target
    texts = tuple(str(label) for label in labels)
    if len(texts) != len(target.face_labels):
        raise InputError(
            f"labels: expected {len(target.face_labels)}, one for each probability, got "
            f"{len(texts)}; add or remove some"
        )
    if len(set(texts)) < 2:
        raise InputError(
            f"labels: expected at least two different ones, got {texts[0]!r} alone; rename some"
        )
    return replace(target, face_labels=texts)


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
    if outcomes > MOST_FACES:
        raise InputError(
            f"{name}: expected at most {MOST_FACES} outcomes, got {outcomes}; join some"
        )
