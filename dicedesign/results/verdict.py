"""Verdicts on a finished die, set down and thrown, for everybody who rolls it."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from enum import Enum

import numpy as np

from dicedesign.results.parts import Numbers, Status
from dicedesign.results.result import Result

INVISIBLE = 1e-8
"""Largest |p - q| below which a verdict gives no digits: a millionth of a percentage point."""

NEARLY = 1e-3
"""Largest |p - q| at which a verdict says "has your probabilities", not "nearly has"."""

ANY_HAND = 5e-4
"""Total variation for nine in ten hands below which a die is right in any hand: what labels may
change. Only symmetry makes it so."""

MODEL_ERROR = 0.01
"""Total variation that the momentum model is off by for dice of many faces; see docs/numbers.md."""


class Mark(Enum):
    """Mark of a verdict; the value is its word."""

    GOOD = "good"
    CAUTION = "caution"
    NOT_YET = "not yet"


@dataclass(frozen=True)
class Verdict:
    """One sentence about a way to roll a die, "Set down" or "Thrown", and its mark."""

    way: str
    mark: Mark
    sentence: str


def judge(result: Result) -> tuple[Verdict, Verdict]:
    """Verdicts on the die to print: set down, and thrown."""
    (mark, set_down), (thrown_mark, thrown) = _judge_set_down(result), _judge_thrown(result)
    return Verdict("Set down", mark, set_down), Verdict("Thrown", thrown_mark, thrown)


def _judge_set_down(result: Result) -> tuple[Mark, str]:
    error = result.max_abs_error
    if result.engraved is not None and result.engraved.max_abs_error is not None:
        error = result.engraved.max_abs_error
    off = f"off by {error_in_words(error)}"
    has = "nearly has" if error > NEARLY else "has"
    if result.thrown is not None:
        if error <= NEARLY:
            return Mark.GOOD, f"It has your probabilities: {off}."
        worst = worst_outcome(result.labels, result.printed_probabilities, result.target)
        return Mark.CAUTION, f"It is made for throws: {worst}."
    if result.converged:
        of = "" if result.prior is None else f" under the prior {result.prior}"
        return Mark.GOOD, f"It {has} your probabilities{of}: {off}."
    flaw = Status[result.status.upper()].value.partition(";")[0]
    if error <= NEARLY:
        return Mark.CAUTION, f"It has your probabilities, but {flaw}."
    return Mark.NOT_YET, f"It does not have your probabilities: {off}."


def _judge_thrown(result: Result) -> tuple[Mark, str]:
    if result.thrown is not None:
        table, measured = result.thrown.table["name"], result.thrown.simulated
        got = result.thrown.momentum if measured is None else measured.frequencies
        off = percentage_points(float(np.abs(np.subtract(got, result.target)).sum()) / 2.0)
        source, chance = "by the momentum model", ""
        if measured is not None:
            off = percentage_points(measured.total_variation)
            source = f"in {measured.drops:,} simulated throws"
            chance = f" ({percentage_points(measured.noise_floor)} by chance)"
        mark = Mark.GOOD if result.converged else Mark.NOT_YET
        has = "has" if result.converged else "does not have"
        sentence = f"it {has} your probabilities: off by {off} {source}{chance}."
        return mark, f"On your table ({table}) {sentence}"
    forecast = result.forecast
    if forecast is None:
        return Mark.CAUTION, "Its probabilities are not known: set it down gently."
    off = percentage_points(max(forecast.total_variation, MODEL_ERROR))
    model, table = "by the momentum model", f"On your table ({forecast.table})"
    if forecast.is_off(result.target):
        worst = worst_outcome(result.labels, forecast.probabilities, result.target)
        return Mark.CAUTION, f"{table} it is off, {model}: {worst}."
    if not result.converged:
        return Mark.NOT_YET, f"{table} it is off by about {off}, {model}."
    if forecast.nine_in_ten < ANY_HAND:
        return Mark.GOOD, "It has your probabilities in any hand, as its faces are alike."
    return Mark.GOOD, f"{table} it is off by about {off}, {model}."


def error_in_words(error: float) -> str:
    """Largest error of a probability, in words."""
    if error < INVISIBLE:
        return "less than a millionth of a percentage point"
    return f"at most {percentage_points(error)}"


def worst_outcome(labels: tuple[str, ...], got: Numbers, target: Numbers) -> str:
    """Clause about the outcome with the largest error over its probability."""
    errors = [abs(p / q - 1.0) for p, q in zip(got, target, strict=True)]
    worst = errors.index(max(errors))
    return (
        f"{labels[worst]} comes up in {100.0 * got[worst]:.3g} % of cases instead of "
        f"{100.0 * target[worst]:.3g} %"
    )


def percentage_points(error: float) -> str:
    """Probability in percentage points, rounded up to two digits, without an exponent."""
    rounded = Context(prec=2, rounding=ROUND_CEILING).create_decimal(100.0 * error)
    return f"{rounded.normalize():f} percentage point{'s' * (rounded != 1)}"
