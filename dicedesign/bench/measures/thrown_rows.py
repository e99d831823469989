"""What came of dice that are designed for throws."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from dicedesign.results.status import Status
from dicedesign.throws.statistics.total_variation import MeasuredDistance

__all__ = ["Change", "DieThrows", "ThrownRow"]


@dataclass(frozen=True)
class DieThrows:
    """One design, and its throws on the table of the recipe.

    Attributes
    ----------
    status: of the design, which took `seconds` on the wall.
    rounds: of throws and new designs that it took; round_drops: throws in all of them.
    engraved: whether the die was thrown with its labels cut.
    drops: fresh ones; lost: of these, those that ended on no outcome.
    to_target: total variation of the fresh throws from the target.
    geometric, momentum: total variation between the odds of that model and the frequencies.
    """

    status: Status
    seconds: float
    rounds: int
    round_drops: int
    engraved: bool
    drops: int
    lost: int
    to_target: MeasuredDistance
    geometric: float
    momentum: float


@dataclass(frozen=True)
class Change:
    """Throws of the refined die on a table with one parameter changed.

    Attributes
    ----------
    parameter: one of `PARAMETERS`. factor: on it. value: that it has then, in SI units.
    drops: how many; lost: of these, those that ended on no outcome.
    to_target: total variation from the target.
    """

    parameter: str
    factor: float
    value: float
    drops: int
    lost: int
    to_target: MeasuredDistance

    @property
    def above_noise(self) -> float:
        """Total variation less what chance adds in the square."""
        return math.sqrt(max(self.to_target.value**2 - self.to_target.noise_floor**2, 0.0))


@dataclass(frozen=True)
class ThrownRow:
    """One recipe.

    Attributes
    ----------
    name, table: of the recipe; engine: of the fresh throws.
    within: total variation that the recipe asks for.
    before: the die designed for odds without momentum. after: the recipe's own. None where there is
        none to throw.
    changes: the latter on changed tables.
    left_out: changes that no table can have, and why.
    note: what is wrong, or "".
    """

    name: str
    table: str
    engine: str
    within: float
    before: DieThrows | None
    after: DieThrows | None
    changes: tuple[Change, ...]
    left_out: tuple[str, ...]
    note: str

    @property
    def worst(self) -> Change | None:
        """The change with the largest total variation."""
        return max(self.changes, key=lambda change: change.to_target.value, default=None)

    @property
    def missed(self) -> bool:
        """Whether there is no such die, or it is beyond `within` and chance is not the reason."""
        after = self.after
        if after is None or after.status is not Status.CONVERGED:
            return True
        return after.to_target.interval[0] > self.within

    def plain(self) -> dict[str, Any]:
        """Everything for JSON."""
        row = asdict(self)
        for key in ("before", "after"):
            if row[key] is not None:
                row[key]["status"] = row[key]["status"].name.lower()
        for plain, change in zip(row["changes"], self.changes, strict=True):
            plain["above_noise"] = change.above_noise
        return {**row, "missed": self.missed}
