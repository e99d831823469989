"""Stage figures: the pictures of the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dicedesign.fabricate.die import FinishedDie
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.runtime.arrays import Floats

__all__ = ["draw_figures", "finished_die"]


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
        repaired=work.repaired,
        thrown=work.thrown,
        reading=work.reading,
    )


def _upward(work: Work) -> Floats:
    """The direction (3,) that is upward in the pictures."""
    from dicedesign.report.render.cameras import upward_of

    mesh = work.recipe.start.mesh
    return np.array([0.0, 0.0, 1.0]) if mesh is None else upward_of(Path(mesh.path))
