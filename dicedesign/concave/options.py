"""Options of the concave method and its built-in surfaces, in recipes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Final, Literal

import numpy as np

from dicedesign.errors import InputError
from dicedesign.optimize.options import (
    LARGEST_SMOOTHING,
    PaperWeights,
    SobolevOptions,
    refuse,
    require_choice,
)
from dicedesign.optimize.starts.start import StartKind, StartSurface
from dicedesign.runtime.registry import STRICT


class HullWeights(PaperWeights):
    """Weights of the terms beside the dice energy for a dense hull, in the unit of the paper; see
    `TERMS`.

    With the weights of figure 15 (coplanar, barycenter and neighbor 0.01 to 0.3) clusters reach the
    probabilities, but most keep several distant rests. The defaults leave one rest in each. Raises
    InputError for a number out of range.
    """

    __slots__ = ()

    defaults: ClassVar = {**PaperWeights.defaults, "coplanar": 1.0, "neighbor": 0.05, "apart": 0.3}


@dataclass(frozen=True)
class ConcavePaperOptions:
    """Options of `hull: paper` and `fill: paper`.

    The first six belong to the hull (section 3.3), the others to the fill (appendix B): quadratic
    programs for `closest_point E_CP + membrane E_m + bending E_b` (eq. 26), then steps (eq. 35) for
    `center_of_mass E_CoM + membrane E_m + bending E_b` (eq. 31). E_m is the mean over the surface,
    E_b a sum over its edges. Lengths are relative to the diagonal of the surface's box.

    Attributes
    ----------
    weights: weights of the terms beside the dice energy, in the unit of the paper, for the first
        hull; other hulls multiply them by seeded factors.
    sobolev: preconditioning of the gradient in the hull's vertices; the default keeps most vertices
        of a dense hull.
    drift: whether steps may shift the whole hull, as in the paper: this changes probabilities most
        easily, but the fill must then move the center of mass far.
    step: "momentum", which crosses jumps of the energy, or "line_search" as in the paper.
    steps: maximum number of steps, at least 1.
    finish: "exact" continues to the exact probabilities if each outcome has one rest and there are
        no other rests; "none" ends as in the paper.
    closest_point: lambda_CP of the first program, positive.
    membrane: lambda_m, positive.
    bending: lambda_b, positive.
    center_of_mass: lambda_CoM of the first steps, positive.
    growth: factor by which lambda_CP and lambda_CoM grow, above 1 and at most 100.
    gamma: smoothing of the gradient in the points of the surface, above 0 and at most 1e6.
    power: number p of smoothing passes, 1 to 4.
    """

    __pydantic_config__ = STRICT

    weights: HullWeights = field(default_factory=HullWeights)
    sobolev: SobolevOptions = field(default_factory=lambda: SobolevOptions(smoothing=5.0, power=2))
    drift: bool = False
    step: Literal["momentum", "line_search"] = "momentum"
    steps: int = 600
    finish: Literal["exact", "none"] = "exact"
    closest_point: float = 1.0
    membrane: float = 1.0
    bending: float = 0.02
    center_of_mass: float = 100.0
    growth: float = 2.0
    gamma: float = 5.0
    power: int = 2

    def __post_init__(self) -> None:
        require_choice("paper.step", self.step, "momentum", "line_search")
        require_choice("paper.finish", self.finish, "exact", "none")
        positive = {
            name: (0.0 < getattr(self, name) < np.inf, "a positive number")
            for name in ("closest_point", "membrane", "bending", "center_of_mass")
        }
        _require(
            self,
            "paper.",
            steps=(self.steps >= 1, "a whole number above 0"),
            **positive,
            growth=(1.0 < self.growth <= 100.0, "a number above 1 and at most 100"),
            gamma=(
                0.0 < self.gamma <= LARGEST_SMOOTHING,
                f"a number above 0 and at most {LARGEST_SMOOTHING:g}",
            ),
            power=(1 <= self.power <= 4, "1 to 4"),
        )


FEWEST_POINTS = 50
"""Minimum of `ConcaveOptions.points`."""


@dataclass(frozen=True)
class HollowOptions:
    """Options of cavities that help to move the center of mass.

    Attributes
    ----------
    wall_mm: minimum thickness of walls around cavities, in mm; positive.
    """

    __pydantic_config__ = STRICT

    wall_mm: float = 2.0

    def __post_init__(self) -> None:
        _require(self, wall_mm=(0.0 < self.wall_mm < np.inf, "a positive number"))


@dataclass(frozen=True)
class ConcaveOptions:
    """Options of `method: concave`.

    Attributes
    ----------
    tolerance: largest |p - q| over clusters of rests within 5 degrees, and largest total
        probability of all other rests; above 0 and below 1.
    hull: design of the hull: "gauss_newton", or "paper" for descent on the clustered energy with
        its regularizers.
    fill: fill of the hull by the surface: "correspondence", or "paper" for quadratic programs and a
        correction of the center of mass.
    paper: options of "paper" above, or None for the defaults.
    apart_deg: minimum angle between the rests of two outcomes, in degrees; at least 0 and below
        180.
    margin_deg: minimum angle by which the die can be tipped without leaving an outcome, in degrees;
        at least 0 and below 90.
    prints_within: largest mean total variation of prints from the target; above 0 and at most 1.
    hollow: cavities that move the center of mass, so that the surface needs less bending; None for
        a solid die.
    points: approximate number of points to which the surface is decimated or refined first; None
        to keep its own.
    attempts: maximum number of attempts at a hull, at least 1; the best is kept.
    displacement: mean displacement over the diagonal at which the search ends, positive.
    enough: attempts after which a converged die is accepted at any displacement, at least 1; half
        as many more if its prints are off by more than half of `prints_within`, at any
        displacement.
    seconds: wall-clock limit after which no further attempt starts, positive; None for no limit.
        With one, the result depends on the speed of the machine.
    """

    __pydantic_config__ = STRICT

    tolerance: float = 0.005
    hull: Literal["gauss_newton", "paper"] = "gauss_newton"
    fill: Literal["correspondence", "paper"] = "correspondence"
    paper: ConcavePaperOptions | None = None
    apart_deg: float = 45.0
    margin_deg: float = 10.0
    prints_within: float = 0.03
    hollow: HollowOptions | None = None
    points: int | None = None
    attempts: int = 60
    displacement: float = 0.01
    enough: int = 24
    seconds: float | None = None

    def __post_init__(self) -> None:
        require_choice("hull", self.hull, "gauss_newton", "paper")
        require_choice("fill", self.fill, "correspondence", "paper")
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
        _require(
            self,
            tolerance=(0.0 < self.tolerance < 1.0, "a number above 0 and below 1"),
            apart_deg=(0.0 <= self.apart_deg < 180.0, "degrees from 0 to below 180"),
            margin_deg=(0.0 <= self.margin_deg < 90.0, "degrees from 0 to below 90"),
            prints_within=(0.0 < self.prints_within <= 1.0, "a number above 0 and at most 1"),
            attempts=(self.attempts >= 1, "a whole number above 0"),
            enough=(self.enough >= 1, "a whole number above 0"),
            displacement=(0.0 < self.displacement < np.inf, "a positive number"),
        )
        if self.seconds is not None and not 0.0 < self.seconds < np.inf:
            raise refuse("seconds", "a positive number", self.seconds, "no limit")


def _require(options: object, prefix: str = "", **checks: tuple[bool, str]) -> None:
    """Raise InputError for an option out of range.

    checks: for each option, whether its value is valid and the expected values in words.
    """
    for name, (is_valid, expected) in checks.items():
        if not is_valid:
            default = getattr(type(options), name)
            raise refuse(prefix + name, expected, getattr(options, name), f"{default:g}")


def _start_shape(name: str, _: int) -> StartSurface:
    from dicedesign.concave.shapes import shape

    return StartSurface(shape(name))


SHAPE: Final = StartKind(
    name="shape",
    line="a surface built in, `dragon`, `duck`, `kitten` or `knot`, for method concave",
    # Equal to `SHAPES`, whose module takes long to import.
    options=Literal["dragon", "duck", "kitten", "knot"],
    surface=_start_shape,
)
