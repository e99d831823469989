"""Options of balancing a body."""

from __future__ import annotations

from dataclasses import dataclass, field

from dicedesign.balance.center.best_center import CenterSearch
from dicedesign.balance.ways.material import Material
from dicedesign.balance.ways.ways import WAYS
from dicedesign.errors import InputError
from dicedesign.runtime.checks import is_finite_number
from dicedesign.tolerances import FILE_ODDS, LEAST_MM, MOST_MM

__all__ = ["BalanceOptions"]


@dataclass(frozen=True)
class BalanceOptions(Material):
    """Where the center of mass may be, how it gets there, and what the body is made of, see
    `Material`.

    Attributes
    ----------
    region: "hull", anywhere in the body's convex hull; "hollow", where cavities can bring it; or
        six numbers, the least x, y, z of a box and then its largest, in mm.
    by: "cavity", "infill" or "weights"; None for the first of these that reaches the goal, or else
        that which comes nearest.
    size_mm: largest distance between two points of the body; None for a body that is in mm.
    tolerance: largest difference of odds with which a goal is reached.
    search: how long is looked for a center of mass.

    Raises InputError for a value out of its range.
    """

    region: str | tuple[float, ...] = "hull"
    by: str | None = None
    size_mm: float | None = None
    tolerance: float = 0.005
    search: CenterSearch = field(default_factory=CenterSearch)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.region, str):
            if self.region not in ("hull", "hollow"):
                raise InputError(
                    f"region: expected hull, hollow or a box of six numbers, got {self.region!r}; "
                    "take hull"
                )
        elif len(self.region) != 6 or not all(map(is_finite_number, self.region)):
            raise InputError(
                "region: expected six numbers for a box, its least x,y,z and then its largest, got "
                f"{self.region}; or take hull"
            )
        if self.by is not None and self.by not in WAYS:
            raise InputError(
                f"by: expected {', '.join(WAYS)}, got {self.by!r}; or leave it out for the first "
                "that does it"
            )
        if self.size_mm is not None and not (
            is_finite_number(self.size_mm) and LEAST_MM <= self.size_mm <= MOST_MM
        ):
            raise InputError(
                f"size_mm: expected a number from {LEAST_MM:g} to {MOST_MM:g}, got "
                f"{self.size_mm!r}; it is the largest distance between two points"
            )
        if not is_finite_number(self.tolerance) or not FILE_ODDS <= self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number from {FILE_ODDS:g} to 1, got {self.tolerance!r}; "
                "0.005 is half a percent"
            )
