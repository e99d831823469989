"""Dice through a tower."""

from __future__ import annotations

from dicedesign.throws.hand import HANDS, Hand

HANDS.register(
    Hand(
        name="tower",
        line="dropped through a dice tower, out of which it tumbles over a ramp",
        rank=30,
        height=(0.04, 0.08),
        speed=(0.3, 0.8),
        spin=(15.0, 60.0),
        phrase="through a dice tower",
        source="chosen, not measured: it comes off the last of the ledges, having kept a third to "
        "two thirds of the speed of a fall of 8 cm, and spins about as it would roll so fast",
    )
)
