"""Dice out of a cup."""

from __future__ import annotations

from dicedesign.throws.hand import HANDS, Hand

HANDS.register(
    Hand(
        name="cup",
        line="shaken in a cup and tipped out low over the table",
        rank=10,
        height=(0.05, 0.12),
        speed=(0.1, 0.6),
        spin=(5.0, 30.0),
        phrase="out of a cup",
        source="chosen, not measured: it leaves the rim of a tipped cup at the speed of the cup, "
        "and turns about as it would roll over the rim",
    )
)
