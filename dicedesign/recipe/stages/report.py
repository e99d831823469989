"""Stage report: one page that shows it all."""

from __future__ import annotations

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work

__all__ = ["write_page"]


def write_page(work: Work) -> None:
    """Make report.html of the result and the figures."""
    from dicedesign.report.pages.die_page import die_page

    work.files["report.html"] = die_page(work.result(), work.images).encode("utf-8")


STAGES.register(
    Stage(
        name="report",
        line="makes report.html, which needs no other file",
        rank=90,
        wanted=lambda work: work.recipe.report and work.folder is not None,
        run=write_page,
    )
)
