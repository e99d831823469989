"""Options of `method: concave`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from dicedesign.concave.fill.paper_options import ConcavePaperOptions
from dicedesign.errors import InputError
from dicedesign.optimize.options import require_choice
from dicedesign.runtime.registry import STRICT

__all__ = ["ConcaveOptions", "HollowOptions"]

FEWEST_POINTS: Final = 50
"""Of a surface that is to be decimated."""


@dataclass(frozen=True)
class HollowOptions:
    """Cavities that help to bring the center of mass to where it is wanted.

    Attributes
    ----------
    wall_mm: least thickness of the walls around them, in mm; positive.
    """

    __pydantic_config__ = STRICT

    wall_mm: float = 2.0

    def __post_init__(self) -> None:
        if not 0.0 < self.wall_mm < np.inf:
            raise InputError(
                f"wall_mm: expected a positive number, got {self.wall_mm:g}; leave it out for 2"
            )


@dataclass(frozen=True)
class ConcaveOptions:
    """Options of `method: concave`.

    Attributes
    ----------
    tolerance: largest |p - q| wanted, over clusters of rests within 5 degrees, and largest odds of
        all other rests together; above 0 and below 1.
    hull: how the hull is designed: "gauss_newton", or "paper": by descent on the clustered energy
        with its regularizers.
    fill: how the surface is made to fill it: "correspondence", or "paper": by quadratic programs
        and a correction of the center of mass.
    paper: options of "paper" above, or None for the defaults.
    apart_deg: least angle wanted between two outcomes' rests, in degrees; not negative and below
        180.
    margin_deg: least angle wanted by which the die must be tipped to leave an outcome, in degrees;
        not negative and below 90.
    hollow: cavities that may shift the center of mass, so that the surface need be bent less; None
        for a solid die.
    points: about as many the surface is decimated or refined to first; None to leave it.
    attempts: most ways to a hull that are tried, at least 1; the best is kept.
    displacement: mean displacement over the diagonal from which on no better one is sought,
        positive.
    enough: attempts after which a die that is as wanted is not brought nearer to the original, at
        least 1.
    seconds: wall-clock time after which no further attempt is begun, positive; None for no limit.
        With one the result depends on the speed of the machine.
    """

    __pydantic_config__ = STRICT

    tolerance: float = 0.005
    hull: Literal["gauss_newton", "paper"] = "gauss_newton"
    fill: Literal["correspondence", "paper"] = "correspondence"
    paper: ConcavePaperOptions | None = None
    apart_deg: float = 45.0
    margin_deg: float = 10.0
    hollow: HollowOptions | None = None
    points: int | None = None
    attempts: int = 60
    displacement: float = 0.01
    enough: int = 24
    seconds: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number above 0 and below 1, got {self.tolerance:g}; leave "
                "it out for 0.005"
            )
        require_choice("hull", self.hull, "gauss_newton", "paper")
        require_choice("fill", self.fill, "correspondence", "paper")
        for angle, degrees, limit, default in (
            ("apart_deg", self.apart_deg, 180.0, 45),
            ("margin_deg", self.margin_deg, 90.0, 10),
        ):
            if not 0.0 <= degrees < limit:
                raise InputError(
                    f"{angle}: expected degrees from 0 to below {limit:g}, got {degrees:g}; leave "
                    f"it out for {default}"
                )
        if self.paper is not None and "paper" not in (self.hull, self.fill):
            raise InputError(
                f"paper: expected hull: paper or fill: paper with it, got {self.hull} and "
                f"{self.fill}; leave paper out, or write one of them"
            )
        if self.hollow is not None and "paper" in (self.hull, self.fill):
            raise InputError(
                "hollow: expected hull: gauss_newton and fill: correspondence with it, got "
                f"{self.hull} and {self.fill}; leave hollow or paper out"
            )
        if self.points is not None and self.points < FEWEST_POINTS:
            raise InputError(
                f"points: expected at least {FEWEST_POINTS}, got {self.points}; raise it, or leave "
                "it out to keep the surface as it is"
            )
        for name, most, default in (("attempts", self.attempts, 60), ("enough", self.enough, 24)):
            if most < 1:
                raise InputError(
                    f"{name}: expected a whole number above 0, got {most}; leave it out for "
                    f"{default}"
                )
        for name, number in (("displacement", self.displacement), ("seconds", self.seconds)):
            if number is not None and not 0.0 < number < np.inf:
                raise InputError(
                    f"{name}: expected a positive number, got {number:g}; leave it out"
                )
