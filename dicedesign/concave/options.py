"""What a recipe says of a concave die, its surface and its method, which it does not load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

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
from dicedesign.runtime.registry import STRICT, Number


class HullWeights(PaperWeights):
    """Weights beside the dice energy of a dense hull, in the published unit; see `TERMS`.

    With those of figure 15 (coplanar, barycenter and neighbor 0.01 to 0.3) clusters reach the
    probabilities, but most keep several rests far apart. The defaults leave one rest each. Raises
    InputError for a number out of range.
    """

    __slots__ = ()

    @classmethod
    def list_numbers(cls) -> Mapping[str, Number]:
        """Weights and options of all terms, with defaults for hulls."""
        defaults = {"coplanar": 1.0, "barycenter": 0.1, "neighbor": 0.05, "apart": 0.3}
        return {
            name: replace(number, default=defaults.get(name, number.default))
            for name, number in super().list_numbers().items()
        }


@dataclass(frozen=True)
class ConcavePaperOptions:
    """Options of `hull: paper` and `fill: paper`.

    The first six are of the hull (section 3.3), the others of the fill (appendix B): first come
    quadratic programs for `closest_point E_CP + membrane E_m + bending E_b` (eq. 26), then steps
    (eq. 35) for `center_of_mass E_CoM + membrane E_m + bending E_b` (eq. 31). E_m is the mean over
    the surface, E_b a sum over its edges, and lengths are over the diagonal of the surface's box.

    Attributes
    ----------
    weights: weights of the terms beside the dice energy, in the paper's unit, for the first hull;
        other hulls multiply them by seeded factors.
    sobolev: preconditioning of the gradient in the hull's corners; the default keeps most corners
        of a dense hull.
    drift: whether steps may shift the whole hull, as in the paper: the cheapest way to change
        probabilities, but the fill must then move the center of mass far.
    step: "momentum", over jumps of the energy, or "line_search", the paper's.
    steps: most steps, at least 1.
    finish: "exact" continues to the exact probabilities if each outcome has one rest and there is
        no other; "none" ends as in the paper.
    closest_point: lambda_CP of the first program, positive.
    membrane: lambda_m, positive.
    bending: lambda_b, positive.
    center_of_mass: lambda_CoM of the first steps, positive.
    growth: factor by which lambda_CP and lambda_CoM grow, above 1 and at most 100.
    gamma: smoothing of the gradient in the surface's points, above 0 and at most 1e6.
    power: p, number of smoothing passes, 1 to 4.
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
        _require(self, "steps", self.steps >= 1, "a whole number above 0", "paper.")
        for name in ("closest_point", "membrane", "bending", "center_of_mass"):
            is_positive = 0.0 < getattr(self, name) < np.inf
            _require(self, name, is_positive, "a positive number", "paper.")
        is_growth = 1.0 < self.growth <= 100.0
        _require(self, "growth", is_growth, "a number above 1 and at most 100", "paper.")
        is_gamma = 0.0 < self.gamma <= LARGEST_SMOOTHING
        expected = f"a number above 0 and at most {LARGEST_SMOOTHING:g}"
        _require(self, "gamma", is_gamma, expected, "paper.")
        _require(self, "power", 1 <= self.power <= 4, "1 to 4", "paper.")


FEWEST_POINTS = 50
"""Of a surface that is to be decimated."""


@dataclass(frozen=True)
class HollowOptions:
    """Cavities that help to bring the center of mass to where it is wanted.

    Attributes
    ----------
    wall_mm: least thickness of the cavity's walls, in mm; positive.
    """

    __pydantic_config__ = STRICT

    wall_mm: float = 2.0

    def __post_init__(self) -> None:
        _require(self, "wall_mm", 0.0 < self.wall_mm < np.inf, "a positive number")


@dataclass(frozen=True)
class ConcaveOptions:
    """Options of `method: concave`.

    Attributes
    ----------
    tolerance: largest |p - q| wanted, over clusters of rests within 5 degrees, and largest total
        probability of all other rests; above 0 and below 1.
    hull: design of the hull: "gauss_newton", or "paper" for descent on the clustered energy with
        its regularizers.
    fill: fill of the hull by the surface: "correspondence", or "paper" for quadratic programs and a
        correction of the center of mass.
    paper: options of "paper" above, or None for the defaults.
    apart_deg: least angle wanted between two outcomes' rests, in degrees; not negative and below
        180.
    margin_deg: least angle wanted by which the die can be tipped without leaving an outcome, in
        degrees; not negative and below 90.
    hollow: cavities that shift the center of mass, so that the surface needs less bending; None for
        a solid die.
    points: approximate number of points to decimate or refine the surface to first; None to leave
        it.
    attempts: most attempts at a hull, at least 1; the best is kept.
    displacement: mean displacement over the diagonal at which the search ends, positive.
    enough: attempts after which a converged die is accepted at any displacement, at least 1.
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
        _require(self, "tolerance", 0.0 < self.tolerance < 1.0, "a number above 0 and below 1")
        _require(self, "apart_deg", 0.0 <= self.apart_deg < 180.0, "degrees from 0 to below 180")
        _require(self, "margin_deg", 0.0 <= self.margin_deg < 90.0, "degrees from 0 to below 90")
        _require(self, "attempts", self.attempts >= 1, "a whole number above 0")
        _require(self, "enough", self.enough >= 1, "a whole number above 0")
        _require(self, "displacement", 0.0 < self.displacement < np.inf, "a positive number")
        if self.seconds is not None and not 0.0 < self.seconds < np.inf:
            raise refuse("seconds", "a positive number", self.seconds, "no limit")


def _require(options: object, name: str, is_valid: bool, expected: str, prefix: str = "") -> None:
    """Raise InputError for an option out of range."""
    if not is_valid:
        default = getattr(type(options), name)
        raise refuse(prefix + name, expected, getattr(options, name), f"{default:g}")


def _start_shape(name: str, _: int) -> StartSurface:
    from dicedesign.concave.shapes import shape

    return StartSurface(shape(name))


SHAPE: Final = StartKind(
    name="shape",
    line="a surface built in, `dragon`, `duck`, `kitten` or `knot`, for method concave",
    # `SHAPES`, whose builders take long to import.
    options=Literal["dragon", "duck", "kitten", "knot"],
    surface=_start_shape,
)
