"""Hands: ways in which people throw dice, whatever they throw them onto."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dicedesign.runtime.folder_registry import FolderRegistry
from dicedesign.runtime.registry import Extension
from dicedesign.throws.spreads import Spread

__all__ = ["HANDS", "Hand"]


@dataclass(frozen=True, kw_only=True)
class Hand(Extension):
    """A way to throw a die, with any side down alike.

    Attributes
    ----------
    height, speed, spin: as of `dicedesign.throws.tables.Table`.
    phrase: how the die is thrown, for sentences: "Throw it ...".
    source: where the numbers come from.
    """

    height: Spread
    speed: Spread
    spin: Spread
    phrase: str
    source: str


HANDS: Final = FolderRegistry[Hand]("hand", "dicedesign.throws.hands", Hand)
"""All of them."""
