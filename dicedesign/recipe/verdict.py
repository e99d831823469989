"""Verdict on a finished die in words: set down and thrown, then its status."""

from __future__ import annotations

from decimal import ROUND_CEILING, Context
from typing import TYPE_CHECKING

from dicedesign.results.parts import Numbers, Status, ThrowForecast

if TYPE_CHECKING:
    from dicedesign.recipe.pipeline import Work

INVISIBLE = 1e-8
"""Largest |p - q| below which the verdict gives no digits: a millionth of a percentage point."""

NEARLY = 1e-3
"""Largest |p - q| at which the verdict says "has your probabilities", not "nearly has"."""

ANY_HAND = 5e-4
"""Total variation for nine in ten hands below which a die is right in any hand: what labels may
change. Only symmetry makes it so."""

MODEL_ERROR = 0.01
"""Total variation that the momentum model is off by for dice of many faces; see docs/numbers.md."""


def describe_verdict(work: Work) -> str:
    """Verdict in one line, beginning with "Warning" if a die that is right when set down is wrong
    when thrown; and a second line with status and remarks."""
    method, measured = work.recipe.method, work.throws and work.throws.simulated
    subject = "die.stl" if work.engraved and work.engraved.assessment else "The die"
    target = tuple(work.target.probabilities.tolist())
    error, most = work.final.max_abs_error, method.tolerance
    if method.is_thrown:
        subject, error = "By the momentum model the die", work.design_error
    off = f"at most {_percentage_points(error)}"
    if error < INVISIBLE:
        off = "less than a millionth of a percentage point"
    has = "nearly has" if error > NEARLY else "has"
    if measured:
        subject, has = f"Thrown {measured.drops:,} times, the die", "has"
        error, most = measured.total_variation, method.options.refine.within
        chance = measured.noise_floor
        off = f"a total variation of {error:.2g} ({most:.2g} allowed, {chance:.2g} by chance)"
    flaw, _, _ = work.status.value.partition(";")
    if work.status is Status.CONVERGED:
        verdict = f"{subject} {has} your probabilities: off by {off}."
        if method.is_thrown:
            set_down = tuple(work.final.outcomes.probabilities.tolist())
            if work.final.max_abs_error > NEARLY:
                verdict += f" Set down, {_worst(work.target.labels, set_down, target)}."
            else:
                verdict += " Set down it has them too."
        elif work.forecast is not None:
            verdict = _with_throws(subject, has, off, work.forecast, work.target.labels, target)
    elif error <= most:
        verdict = f"{subject} has your probabilities, but {flaw}."
    else:
        verdict = f"{subject} does not have your probabilities: off by {off}."
    return f"{verdict}\n{work.status.name.lower()}: {'; '.join(work.remarks)}"


def _with_throws(
    subject: str,
    has: str,
    off: str,
    forecast: ThrowForecast,
    labels: tuple[str, ...],
    target: Numbers,
) -> str:
    """Verdict on a die that is right when set down. subject, has, off: of that."""
    if forecast.nine_in_ten < ANY_HAND:
        return (
            f"{subject} {has} your probabilities set down, off by {off}, and thrown by any hand, "
            "as a symmetry carries the faces to each other."
        )
    hands = f"up to {_percentage_points(forecast.nine_in_ten)} for nine in ten hands"
    if forecast.is_off(target):
        return (
            f"Warning: thrown onto {forecast.table}, {subject[0].lower()}{subject[1:]} does not "
            "have your probabilities by the momentum model: "
            f"{_worst(labels, forecast.probabilities, target)}. In all, "
            f"{_percentage_points(forecast.total_variation)} are off, {hands}. Set down it {has} "
            f"them: off by {off}."
        )
    thrown = f"off by {_percentage_points(forecast.total_variation)}"
    if forecast.total_variation < MODEL_ERROR:
        thrown = f"off by about {_percentage_points(MODEL_ERROR)}, the accuracy of this model"
    return (
        f"{subject} {has} your probabilities set down, off by {off}, and thrown onto "
        f"{forecast.table}, by the momentum model {thrown}, {hands}."
    )


def _worst(labels: tuple[str, ...], got: Numbers, target: Numbers) -> str:
    """Clause about the outcome with the largest error over its probability."""
    errors = [abs(p / q - 1.0) for p, q in zip(got, target, strict=True)]
    worst = errors.index(max(errors))
    return (
        f"{labels[worst]} comes up in {100.0 * got[worst]:.3g} % of cases instead of "
        f"{100.0 * target[worst]:.3g} %"
    )


def _percentage_points(error: float) -> str:
    """Probability in percentage points, rounded up to two digits, without an exponent."""
    rounded = Context(prec=2, rounding=ROUND_CEILING).create_decimal(100.0 * error)
    return f"{rounded.normalize():f} percentage point{'s' * (rounded != 1)}"
