"""Stage report: one page that shows it all."""

from __future__ import annotations

from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.recipe.stages.figures import finished_die
from dicedesign.recipe.stages.files import die_contents

__all__ = ["write_page"]


def write_page(work: Work) -> None:
    """Make report.html of the result, the printed die and the figures."""
    from dicedesign.report.live.live_die import live_die
    from dicedesign.report.pages.die_page import die_page

    die = finished_die(work)
    live = live_die(die, die_contents(work).parts)
    work.files["report.html"] = die_page(die.result, work.images, live).encode("utf-8")


STAGES.register(
    Stage(
        name="report",
        line="makes report.html, which needs no other file",
        rank=90,
        wanted=lambda work: work.recipe.report and work.folder is not None,
        run=write_page,
    )
)
