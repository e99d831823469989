"""How long a query and a gradient take, as multiples of scipy's convex hull of the same points."""

from __future__ import annotations

from typing import Final

from dicedesign.bench.measures.query_speed import Effort

__all__ = ["FULL", "QUICK"]

FULL: Final = Effort(rounds=20, seconds=1.0)

QUICK: Final = Effort(rounds=5, seconds=0.0)
