"""What the attempts at a concave die led to, and what was wanted of it: a part of `Result`.

Angles are in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from dicedesign.results.status import Status
from dicedesign.tolerances import FILE_ANGLE

__all__ = ["Draft", "TradeOff"]


@dataclass(frozen=True)
class Draft:
    """The best die of an attempt.

    Attributes
    ----------
    attempt: its number, from 1 on. seconds: it took; None without a clock.
    error: largest of |p - q| over the outcomes and the odds of all other rests together.
    displacement: mean over the points of the surface, relative to its diagonal.
    apart_deg: least angle between two outcomes' rests.
    margin_deg: least angle by which it must be tipped to leave an outcome.
    self_intersections: pairs of triangles that meet and should not.
    """

    attempt: int
    seconds: float | None
    error: float
    displacement: float
    apart_deg: float
    margin_deg: float
    self_intersections: int


@dataclass(frozen=True)
class TradeOff:
    """Displacement against odds, separation and margin.

    Attributes
    ----------
    tolerance: largest error wanted. apart_deg, margin_deg: least angles wanted, see `Draft`.
    drafts: of the attempts that led to any, in the order of their numbers.
    """

    tolerance: float
    apart_deg: float
    margin_deg: float
    drafts: tuple[Draft, ...]

    def without_clock(self) -> TradeOff:
        """The same without what a clock told."""
        return replace(self, drafts=tuple(replace(draft, seconds=None) for draft in self.drafts))

    def flaws(self, draft: Draft) -> Iterator[Status]:
        """What a draft is not like that was wanted, the worst first."""
        if draft.error > self.tolerance:
            yield Status.OFF_TARGET
        if draft.self_intersections > 0:
            yield Status.SELF_INTERSECTING
        if draft.apart_deg < self.apart_deg - math.degrees(FILE_ANGLE):
            yield Status.TOO_NEAR
        if draft.margin_deg < self.margin_deg - math.degrees(FILE_ANGLE):
            yield Status.TIPPY
