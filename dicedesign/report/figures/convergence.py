"""Error and energy of a design along its course."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.run_chart import Course, run_chart
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.results.result import Step

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie

__all__ = ["convergence_charts"]

_PREFERENCES: Final = "preferences"
"""Term of the steps that are taken by preference."""


def convergence_charts(history: Sequence[Step], tolerance: float) -> tuple[Chart, Chart]:
    """Error and energy of a design against its run time, or its steps without a clock.

    Of a design that went on by preference once its odds were met, the energy is drawn from there
    on: before, it is the error once more.

    Parameters
    ----------
    history: accepted steps, at least one; those that do not know their error have no point.
    tolerance: error at which the design is done, above 0.

    Raises
    ------
    InputError: the history is empty.
    """
    course = Course(history)
    liked = [step for step in history if _PREFERENCES in step.terms]
    name = "energy of preferences" if liked else "energy"
    errors = [(course.place(s), s.max_abs_error) for s in history if s.max_abs_error is not None]
    energies = [(course.place(step), step.energy) for step in liked or history]
    return (
        run_chart(
            0,
            [errors],
            course,
            "error, max |p − q|",
            title="error",
            levels={f"tolerance {tolerance:.2g}": tolerance},
        ),
        run_chart(1, [energies], course, name, title=name, log=False),
    )


def _draw(die: FinishedDie) -> bytes:
    return sheet(convergence_charts(die.result.history, die.tolerance)).png()


FIGURES.register(
    Figure(
        name="convergence",
        line="error and energy of the design against run time, or steps",
        rank=30,
        title="Course of the design",
        caption=(
            "Largest difference of a probability from its target, and the energy, after each step."
        ),
        wanted=lambda die: die.reshaped is None,
        draw=_draw,
    )
)
