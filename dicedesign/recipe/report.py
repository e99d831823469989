"""Stages figures, data sheet and report: what is drawn and told of a finished die."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.fabricate.die import FinishedDie
from dicedesign.recipe.files import die_contents
from dicedesign.recipe.work import Work
from dicedesign.report.figures import FIGURES, figure_files
from dicedesign.report.render.raster import upward_of
from dicedesign.runtime.arrays import Floats

FIGURES_SHOWN: Final = ("faces", "rests", "reading")
"""Figures of the report that the sheet shows where there is room."""


def draw_figures(work: Work) -> None:
    """Draw the figures that are wanted of the die."""
    work.images = figure_files(finished_die(work))
    suffixes = {figure.name: figure.suffix for figure in FIGURES}
    work.files |= {f"{name}{suffixes[name]}": data for name, data in work.images.items()}


def write_data_sheet(work: Work) -> None:
    """Make data_sheet.pdf and data_sheet.png of the result and the figures."""
    from dicedesign.report.data_sheet import data_sheet, four_views, sheet_facts, sheet_pdf
    from dicedesign.report.render.pictures import decoded
    from dicedesign.report.render.renderer import Surface

    die = finished_die(work)
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    surface = Surface(solid.points, solid.triangles, smooth=die.reshaped is not None)
    file = "die_plain.stl" if die.engraved is None else "die.stl"
    checksum = hashlib.sha256(work.files[file]).hexdigest()
    facts = sheet_facts(die, file, checksum)
    figures = [decoded(work.images[name]) for name in FIGURES_SHOWN if name in work.images]
    sheet = data_sheet(facts, four_views(surface, die.upward), figures)
    pdf = sheet_pdf(sheet, facts.title)
    work.files |= {"data_sheet.png": sheet.png(dpi=150), "data_sheet.pdf": pdf}


def write_page(work: Work) -> None:
    """Make report.html of the result, the printed die and the figures."""
    from dicedesign.report.live_die import live_die
    from dicedesign.report.pages import die_page

    die = finished_die(work)
    live = live_die(die, die_contents(work).parts)
    work.files["report.html"] = die_page(die.result, work.images, live).encode("utf-8")


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
    mesh = work.recipe.start.mesh
    return np.array([0.0, 0.0, 1.0]) if mesh is None else upward_of(Path(mesh.path))
