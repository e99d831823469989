"""Error and energy of a design against its run time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from dicedesign.errors import InputError
from dicedesign.report.charts.chart import Chart, sheet
from dicedesign.report.charts.time_curves import run_chart
from dicedesign.report.figures.figure import FIGURES, Figure

if TYPE_CHECKING:
    from dicedesign.fabricate.finished_die import FinishedDie

__all__ = ["convergence_charts"]

_PREFERENCES: Final = "preferences"
"""Term of the steps that are taken by preference."""


def convergence_charts(
    history: Sequence[Mapping[str, Any]], tolerance: float
) -> tuple[Chart, Chart]:
    """Error and energy of a design against its run time.

    Of a design that went on by preference once its odds were met, the energy is drawn from there
    on: before, it is the error once more.

    Parameters
    ----------
    history: accepted steps, at least one, each with "seconds" since the start, "energy", its
        "terms" by name, and "max_abs_error", the largest |p - q|, at least 0.
    tolerance: error at which the design is done, above 0.

    Raises
    ------
    InputError: the history is empty.
    """
    if not history:
        raise InputError("history: expected at least one step, got none")
    liked = [step for step in history if _PREFERENCES in step["terms"]]
    name = "energy of preferences" if liked else "energy"
    end = max(float(step["seconds"]) for step in history)

    def values(steps: Sequence[Mapping[str, Any]], key: str) -> tuple[list[float], list[float]]:
        return [step["seconds"] for step in steps], [step[key] for step in steps]

    return (
        run_chart(
            0,
            [values(history, "max_abs_error")],
            end,
            "error, max |p − q|",
            title="error against run time",
            levels={f"tolerance {tolerance:.2g}": tolerance},
        ),
        run_chart(
            1,
            [values(liked or history, "energy")],
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
