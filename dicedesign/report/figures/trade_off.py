"""What the attempts at a concave die led to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dicedesign.report.charts.trade_off import trade_off_figure
from dicedesign.report.figures.figure import FIGURES, Figure

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie


def _wanted(die: FinishedDie) -> bool:
    search = die.result.search
    return search is not None and len(search.trade_off.drafts) > 0


def _draw(die: FinishedDie) -> bytes:
    search = die.result.search
    assert search is not None
    return trade_off_figure(search.trade_off, search.attempt, die.result.error_before).png()


FIGURES.register(
    Figure(
        name="trade_off",
        line="displacement against odds of each attempt at a concave die",
        rank=25,
        title="What the attempts led to",
        caption=(
            "Best die of each attempt, by its number: how far the surface was moved, and how far "
            "its odds are from the target, all other rests included. Marks say what is worst of it."
        ),
        wanted=_wanted,
        draw=_draw,
    )
)
