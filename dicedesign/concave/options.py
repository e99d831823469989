"""Options of the concave method and its built-in surfaces, in recipes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dicedesign.errors import InputError
from dicedesign.optimize.options import (
    LARGEST_SMOOTHING,
    PaperWeights,
    Positive,
    SobolevOptions,
)
from dicedesign.optimize.starts.start import StartKind, StartSurface
from dicedesign.runtime.registry import Options
from dicedesign.tolerances import FILE_ANGLE, LEAST_MARGIN, SAME_REST_ANGLE


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
class ConcavePaperOptions(Options):
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

    weights: HullWeights = field(default_factory=HullWeights)
    sobolev: SobolevOptions = field(default_factory=lambda: SobolevOptions(smoothing=5.0, power=2))
    drift: bool = False
    step: Literal["momentum", "line_search"] = "momentum"
    steps: Annotated[int, Field(ge=1)] = 600
    finish: Literal["exact", "none"] = "exact"
    closest_point: Positive = 1.0
    membrane: Positive = 1.0
    bending: Positive = 0.02
    center_of_mass: Positive = 100.0
    growth: Annotated[float, Field(gt=1.0, le=100.0)] = 2.0
    gamma: Annotated[float, Field(gt=0.0, le=LARGEST_SMOOTHING)] = 5.0
    power: Annotated[int, Field(ge=1, le=4)] = 2


FEWEST_POINTS = 50
"""Minimum of `ConcaveOptions.points`."""


@dataclass(frozen=True)
class HollowOptions(Options):
    """Options of cavities that help to move the center of mass.

    Attributes
    ----------
    wall_mm: minimum thickness of walls around cavities, in mm; positive.
    """

    wall_mm: Positive = 2.0


@dataclass(frozen=True)
class ConcaveOptions(Options):
    """Options of `method: concave`.

    Attributes
    ----------
    tolerance: largest |p - q| over clusters of rests within 5 degrees, and largest total
        probability of all other rests; above 0 and below 1.
    rests: "one" for each outcome, or "several": rests are shared out among the outcomes, and the
        surface is bent smoothly and by very little, or not at all if it is hollow.
    hull: design of the hull: "gauss_newton", or "paper" for descent on the clustered energy with
        its regularizers.
    fill: fill of the hull by the surface: "correspondence", or "paper" for quadratic programs and a
        correction of the center of mass.
    paper: options of "paper" above, or None for the defaults.
    apart_deg: minimum angle between the rests of two outcomes, in degrees; at least 0 and below
        180. With several rests for an outcome 5, and 25 is preferred.
    margin_deg: minimum angle by which the die can be tipped without leaving an outcome, in degrees;
        at least 0 and below 90. With several rests for an outcome 0.1.
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

    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.005
    rests: Literal["one", "several"] = "one"
    hull: Literal["gauss_newton", "paper"] = "gauss_newton"
    fill: Literal["correspondence", "paper"] = "correspondence"
    paper: ConcavePaperOptions | None = None
    apart_deg: Annotated[float, Field(ge=0.0, lt=180.0)] = 45.0
    margin_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 10.0
    prints_within: Annotated[float, Field(gt=0.0, le=1.0)] = 0.03
    hollow: HollowOptions | None = None
    points: Annotated[int, Field(ge=FEWEST_POINTS)] | None = None
    attempts: Annotated[int, Field(ge=1)] = 60
    displacement: Positive = 0.01
    enough: Annotated[int, Field(ge=1)] = 24
    seconds: Positive | None = None

    @property
    def least_angles(self) -> tuple[float, float]:
        """Required angles: between two outcomes, and of tipping, in degrees."""
        if self.rests == "one":
            return self.apart_deg, self.margin_deg
        return math.degrees(SAME_REST_ANGLE + FILE_ANGLE), math.degrees(LEAST_MARGIN + FILE_ANGLE)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rests == "several" and "paper" in (self.hull, self.fill):
            raise InputError(
                "rests: expected one with hull: paper or fill: paper, got several; leave paper out"
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


def _start_shape(name: str, _: int) -> StartSurface:
    from dicedesign.concave.shapes import shape

    return StartSurface(shape(name))


SHAPE = StartKind(
    name="shape",
    line="a surface built in, `dragon`, `duck`, `kitten` or `knot`, for method concave",
    # Equal to `SHAPES`, whose module takes long to import.
    options=Literal["dragon", "duck", "kitten", "knot"],
    surface=_start_shape,
)
