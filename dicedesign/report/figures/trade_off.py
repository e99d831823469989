"""What the attempts at a concave die led to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dicedesign.report.charts.trade_off import trade_off_figure
from dicedesign.report.figures.figure import FIGURES, Figure

if TYPE_CHECKING:
    from dicedesign.fabricate.finished_die import FinishedDie


def _wanted(die: FinishedDie) -> bool:
    trade_off = die.result.trade_off
    return trade_off is not None and len(trade_off.drafts) > 0


def _draw(die: FinishedDie) -> bytes:
    result = die.result
    assert result.trade_off is not None
    return trade_off_figure(result.trade_off, result.attempt, result.error_before).png()


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
