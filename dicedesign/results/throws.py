"""What a run found out about its die on a table: parts of `Result`.

Odds are in the order of the labels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

__all__ = ["OtherTables", "RoundOfThrows", "SimulatedThrows", "ThrownOdds"]

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class RoundOfThrows:
    """One round of throws that corrected a design.

    Attributes
    ----------
    drops: throws. deviation: total variation of the frequencies from the target; noise_floor: what
        a perfect die shows.
    expected: total variation of the die's odds that the throws of all rounds let one expect.
    elsewhere_drops: throws onto what the table may be instead, all together. elsewhere: as
        `expected`, on nine of ten of these tables at most; None without any.
    is_kept: whether the die of this round was kept.
    asked: odds that the design of this round was asked for. frequencies: of the outcomes.
    """

    drops: int
    deviation: float
    noise_floor: float
    expected: float
    elsewhere_drops: int
    elsewhere: float | None
    is_kept: bool
    asked: Numbers
    frequencies: Numbers


@dataclass(frozen=True)
class SimulatedThrows:
    """Throws of the finished die.

    Attributes
    ----------
    engine, seed, drops: how it was thrown. unresolved: throws that came to rest nowhere in time.
    counts, frequencies: of the outcomes; intervals: of each an exact 95 % interval.
    total_variation: from the target, with its 95 % interval and what a perfect die shows.
    """

    engine: str
    seed: int
    drops: int
    unresolved: int
    counts: tuple[int, ...]
    frequencies: Numbers
    intervals: tuple[tuple[float, float], ...]
    total_variation: float
    interval: tuple[float, float]
    noise_floor: float


@dataclass(frozen=True)
class OtherTables:
    """Throws of the finished die onto what the table may be instead; see `TableVariations`.

    Attributes
    ----------
    drops: onto all of them together.
    values: total variation from the target on each. often: on nine tables of ten at most; worst.
    chance_often, chance_worst: the same of a perfect die.
    """

    drops: int
    values: Numbers
    often: float
    worst: float
    chance_often: float
    chance_worst: float


@dataclass(frozen=True)
class ThrownOdds:
    """What a die does on a table.

    Attributes
    ----------
    table: its numbers by name, with the die's own size.
    momentum: odds by the momentum model.
    rounds: of throws that corrected the design.
    simulated: throws of the finished die, or None.
    elsewhere: its throws onto what the table may be instead, or None.
    """

    table: dict[str, Any]
    momentum: Numbers
    rounds: tuple[RoundOfThrows, ...]
    simulated: SimulatedThrows | None = None
    elsewhere: OtherTables | None = None
