"""Stage data sheet: one page about the die, to print and keep with it."""

from __future__ import annotations

import hashlib
from typing import Final

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work

__all__ = ["write_data_sheet"]

FIGURES_SHOWN: Final = ("faces", "rests", "reading")
"""Figures of the report that the sheet shows where there is room."""


def write_data_sheet(work: Work) -> None:
    """Make data_sheet.pdf and data_sheet.png of the result and the figures."""
    from dicedesign.recipe.stages.figures import finished_die
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


STAGES.register(
    Stage(
        name="data sheet",
        line="makes data_sheet.pdf and data_sheet.png, one page to print",
        rank=85,
        wanted=lambda work: work.recipe.data_sheet and work.folder is not None,
        run=write_data_sheet,
    )
)
