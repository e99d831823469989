"""Options of balancing: inside of a body, and search for the center of mass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal, get_args

from dicedesign.errors import InputError
from dicedesign.runtime.registry import STRICT
from dicedesign.tolerances import FILE_PROBABILITIES, LEAST_MM, MOST_MM

WayName = Literal["cavity", "infill"]
"""Ways to move a center of mass, in the order in which they are tried."""

LEAST_WALL: Final = 0.05
"""Lower limit of lengths in mm, below any printer's resolution."""


@dataclass(frozen=True)
class BodyMaterial:
    """Walls, infill and drain of a balanced body.

    Raises InputError for a value outside of its range.
    """

    __pydantic_config__ = STRICT

    wall_mm: float = 1.2
    """Least thickness of solid walls, from `LEAST_WALL` to half of `MOST_MM`."""
    drain_mm: float | None = None
    """Diameter of a hole from each cavity to the outside; None for closed ones."""
    infill: tuple[float, float] = (0.1, 0.6)
    """Two infill densities relative to the walls, from 0 to 1, the smaller first."""

    def __post_init__(self) -> None:
        most = 0.5 * MOST_MM
        _check("wall_mm", self.wall_mm, LEAST_WALL, most, "1.2 is three lines of a 0.4 mm nozzle")
        _check("drain_mm", self.drain_mm, LEAST_WALL, most, "3 lets resin and powder out")
        if len(self.infill) != 2 or not 0.0 <= self.infill[0] < self.infill[1] <= 1.0:
            raise InputError(
                "infill: expected two parts from 0 to 1, the smaller first, got "
                f"{', '.join(map(str, self.infill))}; 0.1,0.6 is 10 % and 60 %"
            )


def _check(name: str, value: float | None, least: float, most: float, remedy: str) -> None:
    """Raise InputError for a number outside of its range; None is allowed."""
    if value is not None and not least <= value <= most:
        raise InputError(
            f"{name}: expected a number from {least:g} to {most:g}, got {value!r}; {remedy}"
        )


@dataclass(frozen=True)
class InsideOptions(BodyMaterial):
    """Options of `inside`: how a die gets a given center of mass.

    Raises InputError for a value out of its range.
    """

    __pydantic_config__ = STRICT

    by: WayName = "cavity"
    """"cavity", or two densities of "infill"; `inside: cavity` is short for it."""


MANY_CORNERS: Final = 1000
"""Number of corners of a hull above which the effort is reduced."""


@dataclass(frozen=True)
class CenterSearch:
    """Effort of the search for a center of mass: `samples` points are evaluated, `descents` start
    at the best of them, each with at most `steps` steps of each kind."""

    samples: int = 600
    descents: int = 10
    steps: int = 60

    def for_corners(self, count: int) -> CenterSearch:
        """Effort for a hull, reduced for many corners."""
        part = min(1.0, MANY_CORNERS / count)
        efforts = zip((self.samples, self.descents, self.steps), (60, 3, 15), strict=True)
        return CenterSearch(*(max(min(most, least), round(part * most)) for most, least in efforts))


@dataclass(frozen=True)
class BalanceOptions(BodyMaterial):
    """Options of `balance_body`, in addition to `BodyMaterial`.

    Attributes
    ----------
    by: "cavity" or "infill"; None for the first of these that reaches the goal, or else the one
        that comes nearest.
    size_mm: largest distance between two points of the body; None for a body in mm.
    tolerance: largest difference of probabilities with which a goal is reached.
    search: effort of the search for the center of mass.

    Raises InputError for a value outside of its range.
    """

    by: str | None = None
    size_mm: float | None = None
    tolerance: float = 0.005
    search: CenterSearch = field(default_factory=CenterSearch)

    def __post_init__(self) -> None:
        super().__post_init__()
        ways = get_args(WayName)
        if self.by is not None and self.by not in ways:
            raise InputError(
                f"by: expected {', '.join(ways)}, got {self.by!r}; or leave it out for the first "
                "that does it"
            )
        size_remedy = "it is the largest distance between two points"
        _check("size_mm", self.size_mm, LEAST_MM, MOST_MM, size_remedy)
        if not FILE_PROBABILITIES <= self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number from {FILE_PROBABILITIES:g} to 1, got "
                f"{self.tolerance!r}; 0.005 is half a percent"
            )
