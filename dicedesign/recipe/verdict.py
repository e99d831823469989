"""Verdict on a finished die in words: set down and thrown, then its status."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dicedesign.results.parts import Numbers, Status, ThrowForecast
from dicedesign.results.verdict import (
    ANY_HAND,
    MODEL_ERROR,
    NEARLY,
    error_in_words,
    percentage_points,
    worst_outcome,
)

if TYPE_CHECKING:
    from dicedesign.recipe.pipeline import Work


def describe_verdict(work: Work) -> str:
    """Verdict in one line, beginning with "Warning" if a die that is right when set down is wrong
    when thrown; and a second line with status and remarks."""
    method, measured = work.recipe.method, work.throws and work.throws.simulated
    subject = "die.stl" if work.engraved and work.engraved.assessment else "The die"
    target = tuple(work.target.probabilities.tolist())
    error, most = work.final.max_abs_error, method.tolerance
    if method.is_thrown:
        subject, error = "By the momentum model the die", work.design_error
    off = error_in_words(error)
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
                verdict += f" Set down, {worst_outcome(work.target.labels, set_down, target)}."
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
    hands = f"up to {percentage_points(forecast.nine_in_ten)} for nine in ten hands"
    if forecast.is_off(target):
        return (
            f"Warning: thrown onto {forecast.table}, {subject[0].lower()}{subject[1:]} does not "
            "have your probabilities by the momentum model: "
            f"{worst_outcome(labels, forecast.probabilities, target)}. In all, "
            f"{percentage_points(forecast.total_variation)} are off, {hands}. Set down it {has} "
            f"them: off by {off}."
        )
    thrown = f"off by {percentage_points(forecast.total_variation)}"
    if forecast.total_variation < MODEL_ERROR:
        thrown = f"off by about {percentage_points(MODEL_ERROR)}, the accuracy of this model"
    return (
        f"{subject} {has} your probabilities set down, off by {off}, and thrown onto "
        f"{forecast.table}, by the momentum model {thrown}, {hands}."
    )
