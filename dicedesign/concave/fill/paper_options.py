"""Options of the paper's concave method, apart from the method, so that a recipe loads none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from dicedesign.optimize.options import LARGEST_SMOOTHING, SobolevOptions, refused, require_choice
from dicedesign.optimize.paper_options import PaperWeights
from dicedesign.runtime.numbers import Number
from dicedesign.runtime.registry import STRICT

__all__ = ["ConcavePaperOptions", "HullWeights"]


class HullWeights(PaperWeights):
    """Weights beside the dice energy of a dense hull, in the published unit; see `TERMS`.

    With those of figure 15 (coplanar, barycenter and neighbor 0.01 to 0.3) clusters reach the odds,
    but most keep several rests far apart. The defaults leave one rest each. Raises InputError for a
    number out of range.
    """

    __slots__ = ()

    @classmethod
    def declared(cls) -> Mapping[str, Number]:
        """Those of all terms, with defaults of their own."""
        defaults = {"coplanar": 1.0, "barycenter": 0.1, "neighbor": 0.05, "apart": 0.3}
        return {
            name: replace(number, default=defaults.get(name, number.default))
            for name, number in super().declared().items()
        }


def smooth() -> SobolevOptions:
    """Keeps most corners of a dense hull."""
    return SobolevOptions(smoothing=5.0, power=2)


@dataclass(frozen=True)
class ConcavePaperOptions:
    """Options of `hull: paper` and `fill: paper`.

    The first six are of the hull (section 3.3), the others of the fill (appendix B): first come
    quadratic programs for `closest_point E_CP + membrane E_m + bending E_b` (eq. 26), then steps
    (eq. 35) for `center_of_mass E_CoM + membrane E_m + bending E_b` (eq. 31). E_m is the mean over
    the surface, E_b a sum over its edges, and lengths are over the diagonal of the surface's box.

    Attributes
    ----------
    weights: of the terms beside the dice energy, in the published unit, of the first of the hulls
        that are tried; the others have them times seeded factors.
    sobolev: preconditioning of the gradient in the hull's corners, lambda and p.
    drift: whether its steps may shift the hull as a whole, as the paper's do: that changes the odds
        most cheaply, and leaves the center of mass far from where the fill has to take it.
    step: "momentum", over jumps of the energy, or "line_search", the paper's.
    steps: most steps, at least 1.
    finish: "exact" goes on to the very odds where each outcome has one rest and there is no other;
        "none" ends where the paper does.
    closest_point: lambda_CP of the first program, positive.
    membrane: lambda_m, positive.
    bending: lambda_b, positive.
    center_of_mass: lambda_CoM of the first steps, positive.
    growth: factor by which lambda_CP and lambda_CoM grow, above 1 and at most 100.
    gamma: smoothing of the gradient in the surface's points, above 0 and at most 1e6.
    power: p, how often it is smoothed, 1 to 4.
    """

    __pydantic_config__ = STRICT

    weights: HullWeights = field(default_factory=HullWeights)
    sobolev: SobolevOptions = field(default_factory=smooth)
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
        if self.steps < 1:
            raise refused("paper.steps", "a whole number above 0", self.steps, "600")
        for name, weight, default in (
            ("closest_point", self.closest_point, "1"),
            ("membrane", self.membrane, "1"),
            ("bending", self.bending, "0.02"),
            ("center_of_mass", self.center_of_mass, "100"),
        ):
            if not 0.0 < weight < np.inf:
                raise refused(f"paper.{name}", "a positive number", weight, default)
        if not 1.0 < self.growth <= 100.0:
            raise refused("paper.growth", "a number above 1 and at most 100", self.growth, "2")
        if not 0.0 < self.gamma <= LARGEST_SMOOTHING:
            expected = f"a number above 0 and at most {LARGEST_SMOOTHING:g}"
            raise refused("paper.gamma", expected, self.gamma, "5")
        if not 1 <= self.power <= 4:
            raise refused("paper.power", "1 to 4", self.power, "2")
