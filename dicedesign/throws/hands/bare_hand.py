"""Dice out of the hand."""

from __future__ import annotations

from dicedesign.throws.hand import HANDS, Hand

HANDS.register(
    Hand(
        name="hand",
        line="shaken in the hand and thrown along the table",
        rank=20,
        height=(0.1, 0.3),
        speed=(0.4, 1.4),
        spin=(15.0, 70.0),
        phrase="by hand",
        source="chosen, not measured: around the height, speed and spin that explain published "
        "throws of printed dice, from half of them to about twice",
    )
)
