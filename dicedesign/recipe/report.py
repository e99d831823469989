"""Stages figures, data sheet and report: what is drawn and told of a finished die."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final

import numpy as np

from dicedesign.fabricate.die import FinishedDie
from dicedesign.recipe.files import die_contents
from dicedesign.recipe.work import Work
from dicedesign.report.figures.figure import FIGURES, figure_files
from dicedesign.report.render.cameras import upward_of
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
    from dicedesign.report.render.renderer import Surface
    from dicedesign.report.sheets.data_sheet import VIEW, decoded, draw_data_sheet
    from dicedesign.report.sheets.facts import sheet_facts
    from dicedesign.report.sheets.pages import FINE, PdfPage, PngPage
    from dicedesign.report.sheets.views import four_views

    die = finished_die(work)
    solid = die.plain.body if die.engraved is None else die.engraved
    assert solid.triangles is not None
    surface = Surface(solid.points, solid.triangles, smooth=die.reshaped is not None)
    file = "die_plain.stl" if die.engraved is None else "die.stl"
    checksum = hashlib.sha256(work.files[file]).hexdigest()
    facts = sheet_facts(die, file, checksum)
    views = four_views(surface, die.upward, FINE * VIEW)
    figures = [decoded(work.images[name]) for name in FIGURES_SHOWN if name in work.images]
    png, pdf = PngPage(), PdfPage(facts.title)
    for page in (png, pdf):
        draw_data_sheet(page, facts, views, figures)
    work.files |= {"data_sheet.png": png.content(), "data_sheet.pdf": pdf.content()}


def write_page(work: Work) -> None:
    """Make report.html of the result, the printed die and the figures."""
    from dicedesign.report.live.live_die import live_die
    from dicedesign.report.pages.die_page import die_page

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
