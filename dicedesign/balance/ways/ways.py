"""All ways to put a center of mass where it is wanted."""

from __future__ import annotations

from typing import Final

from dicedesign.balance.ways.cavity import CAVITY
from dicedesign.balance.ways.infill import INFILL
from dicedesign.balance.ways.weights import WEIGHTS

__all__ = ["WAYS"]

WAYS: Final = {way.name: way for way in (CAVITY, INFILL, WEIGHTS)}
"""By name, in the order in which they are tried."""
