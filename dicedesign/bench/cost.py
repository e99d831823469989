"""What a feature costs: a row of `dicedesign bench lean`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["Row", "time_row"]


@dataclass(frozen=True)
class Row:
    """What a feature costs.

    Attributes
    ----------
    feature: what is left out or not.
    quantity: of what the cost is.
    unit: "s", "MB", "ms", "µs" or "calls".
    without: cost where it is left out.
    included: cost with it.
    """

    feature: str
    quantity: str
    unit: str
    without: float
    included: float

    @property
    def ratio(self) -> float | None:
        """How many times as much it costs with the feature; None where nothing was without."""
        return self.included / self.without if self.without > 0.0 else None

    def plain(self) -> dict[str, Any]:
        """The row as plain data, under the names of the table."""
        return {
            "feature": self.feature,
            "measured": self.quantity,
            "unit": self.unit,
            "without": self.without,
            "with": self.included,
            "ratio": self.ratio,
        }


def time_row(feature: str, quantity: str, without: float, included: float) -> Row:
    """A row of two times in seconds, in the unit in which the smaller one is at least 1."""
    unit, scale = ("ms", 1e3) if min(without, included) >= 1e-3 else ("µs", 1e6)
    return Row(feature, quantity, unit, scale * without, scale * included)
