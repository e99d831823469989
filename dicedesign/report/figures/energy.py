"""The energy of each stage of a design along its course."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from dicedesign.report.charts.chart import Chart, draw_legend, sheet
from dicedesign.report.charts.palette import BASINS, repeated
from dicedesign.report.charts.paper import Paper
from dicedesign.report.charts.run_chart import Course, run_chart
from dicedesign.report.charts.series import Band
from dicedesign.report.figures.figure import FIGURES, Figure
from dicedesign.results.result import Step

__all__ = ["energy_charts", "energy_figure"]


def energy_charts(history: Sequence[Step]) -> tuple[Chart, Chart]:
    """Error and energy against run time, or steps without a clock, both logarithmic, with a
    coloured stretch per stage.

    Each stage has an energy of its own, so the curve is broken between stages.

    history: steps in the order of time, at least one, each of a stage; a stage may come again.

    Raises InputError: the history is empty.
    """
    course = Course(history)
    runs = [(name or "", list(steps)) for name, steps in groupby(history, lambda s: s.stage)]
    names = list(dict.fromkeys(name for name, _ in runs))
    colors = dict(zip(names, repeated(BASINS, len(names)), strict=True))
    errors = [(course.place(s), s.max_abs_error) for s in history if s.max_abs_error is not None]
    energies = [[(course.place(step), step.energy) for step in steps] for _, steps in runs]
    error = run_chart(0, [errors], course, "error, max |p − q|", title="error")
    energy = run_chart(1, energies, course, "energy", title="energy of each stage")
    ends = [course.place(steps[-1]) for _, steps in runs]
    bands = [
        Band(begin, end, colors[name], name)
        for begin, end, (name, _) in zip([0.0, *ends], ends, runs, strict=False)
    ]
    error.series[:0] = bands
    energy.series[:0] = bands
    return error, energy


def energy_figure(history: Sequence[Step]) -> Paper:
    """The charts with a legend of the stages below them. Raises InputError: as `energy_charts`."""
    charts = energy_charts(history)
    paper = sheet(charts, below=140.0)
    place = paper.width / 2.0, paper.height - 50.0
    draw_legend(paper, charts[0].series, place, columns=8)
    return paper


FIGURES.register(
    Figure(
        name="energy",
        line="energy and error of a design of several stages against run time, or steps",
        rank=40,
        title="Energy of each stage",
        caption=(
            "Each stage lowers an energy of its own. The error, the largest difference of a "
            "probability from its target, is drawn where it was computed."
        ),
        wanted=lambda die: die.reshaped is not None and len(die.result.history) > 0,
        draw=lambda die: energy_figure(die.result.history).png(),
    )
)
