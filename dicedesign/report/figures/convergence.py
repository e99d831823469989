"""Error and energy of a design against its run time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from dicedesign.errors import InputError
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.run_chart import run_chart
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.results.record import Step

if TYPE_CHECKING:
    from dicedesign.fabricate.finished_die import FinishedDie

__all__ = ["convergence_charts"]

_PREFERENCES: Final = "preferences"
"""Term of the steps that are taken by preference."""


def convergence_charts(history: Sequence[Step], tolerance: float) -> tuple[Chart, Chart]:
    """Error and energy of a design against its run time.

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
    if not history:
        raise InputError("history: expected at least one step, got none")
    liked = [step for step in history if _PREFERENCES in step.terms]
    name = "energy of preferences" if liked else "energy"
    end = max(step.seconds for step in history)
    errors = [(s.seconds, s.max_abs_error) for s in history if s.max_abs_error is not None]
    energies = [(step.seconds, step.energy) for step in liked or history]
    return (
        run_chart(
            0,
            [errors],
            end,
            "error, max |p − q|",
            title="error against run time",
            levels={f"tolerance {tolerance:.2g}": tolerance},
        ),
        run_chart(
            1,
            [energies],
            end,
            name,
            title=f"{name} against run time",
            log=False,
        ),
    )


def _draw(die: FinishedDie) -> bytes:
    return sheet(convergence_charts(die.result.history, die.tolerance)).png()


FIGURES.register(
    Figure(
        name="convergence",
        line="error and energy of the design against run time",
        rank=30,
        title="Error against run time",
        caption=(
            "Largest difference of a probability from its target, and the energy, after each step."
        ),
        wanted=lambda die: die.reshaped is None,
        draw=_draw,
    )
)
