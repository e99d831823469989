"""Stage figures: the pictures of the report."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.fabricate.finished_die import FinishedDie
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.runtime.arrays import Floats

__all__ = ["draw_figures", "finished_die"]

_UPRIGHT: Final = (".stl", ".3mf", ".xyz")
"""Files of programs for printing and construction, whose z axis is upward; in those of programs
for pictures it is y."""


def draw_figures(work: Work) -> None:
    """Draw the figures that are wanted of the die."""
    from dicedesign.report.figures.figure import FIGURES, figure_files

    work.images = figure_files(finished_die(work))
    suffixes = {figure.name: figure.suffix for figure in FIGURES}
    work.files |= {f"{name}{suffixes[name]}": data for name, data in work.images.items()}


STAGES.register(
    Stage(
        name="figures",
        line="draws the pictures of the report, each a file of its own",
        rank=80,
        wanted=lambda work: work.recipe.figures and work.folder is not None,
        run=draw_figures,
    )
)


def finished_die(work: Work) -> FinishedDie:
    """The die of a run as figures draw it."""
    return FinishedDie(
        result=work.result(),
        plain=work.plain,
        engraved=work.engraved,
        tolerance=work.recipe.method.tolerance,
        upward=_upward(work),
        reshaped=work.die.reshaped,
        quality=work.quality,
        thrown=work.thrown,
        reading=work.reading,
    )


def _upward(work: Work) -> Floats:
    """The direction (3,) that is upward in the pictures."""
    mesh = work.recipe.start.mesh
    upright = mesh is None or Path(mesh.path).suffix.lower() in _UPRIGHT
    return np.array([0.0, 0.0, 1.0] if upright else [0.0, 1.0, 0.0])
