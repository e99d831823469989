"""Options of balancing: inside of a body, and search for the center of mass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from dicedesign.errors import InputError
from dicedesign.runtime.registry import Options
from dicedesign.tolerances import FILE_PROBABILITIES, LEAST_MM, MOST_MM

WayName = Literal["cavity", "infill"]
"""Ways to move a center of mass, in the order in which they are tried."""

LEAST_WALL = 0.05
"""Lower limit of lengths in mm, below any printer's resolution."""


Thickness = Annotated[float, Field(ge=LEAST_WALL, le=0.5 * MOST_MM)]
"""Thickness of a wall or diameter of a hole, in mm."""


@dataclass(frozen=True)
class BodyMaterial(Options):
    """Walls, infill and drain of a balanced body.

    Raises InputError for a value outside of its range.
    """

    wall_mm: Thickness = 1.2
    """Least thickness of solid walls, from `LEAST_WALL` to half of `MOST_MM`."""
    drain_mm: Thickness | None = None
    """Diameter of a hole from each cavity to the outside; None for closed ones."""
    infill: tuple[float, float] = (0.1, 0.6)
    """Two infill densities relative to the walls, from 0 to 1, the smaller first."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.infill[0] < self.infill[1] <= 1.0:
            raise InputError(
                "infill: expected two parts from 0 to 1, the smaller first, got "
                f"{', '.join(map(str, self.infill))}; 0.1,0.6 is 10 % and 60 %"
            )


@dataclass(frozen=True)
class InsideOptions(BodyMaterial):
    """Options of `inside`: how a die gets a given center of mass.

    Raises InputError for a value out of its range.
    """

    by: WayName = "cavity"
    """"cavity", or two densities of "infill"; `inside: cavity` is short for it."""


MANY_CORNERS = 1000
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

    by: WayName | None = None
    size_mm: Annotated[float, Field(ge=LEAST_MM, le=MOST_MM)] | None = None
    tolerance: Annotated[float, Field(ge=FILE_PROBABILITIES, lt=1.0)] = 0.005
    search: CenterSearch = field(default_factory=CenterSearch)
