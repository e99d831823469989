"""A designed hull filled as in the paper: quadratic programs, then the center of mass."""

from __future__ import annotations

from collections.abc import Callable

from dicedesign.concave.fill.balance import BalanceOptions, balance
from dicedesign.concave.fill.quadratic_fill import QuadraticFillOptions, fill_by_quadratic_programs
from dicedesign.concave.fill.result import FillResult, FillStep
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["refill"]


def refill(
    surface: Surface,
    hull: ConvexHull,
    corners: Integers,
    center_of_mass: Floats,
    on_step: Callable[[str, FillStep], None],
) -> FillResult:
    """Appendix B of the paper, from the original surface, with known corners.

    corners: (v,) numbers of the points that become the hull's; center_of_mass: (3,) wanted;
    on_step: called with "fill" or "balance" and every step. The status is that of the balance.
    """
    filled = fill_by_quadratic_programs(
        surface,
        hull,
        QuadraticFillOptions(),
        corners=corners,
        center_of_mass=center_of_mass,
        on_step=lambda step: on_step("fill", step),
    )
    return balance(
        surface,
        surface.moved(filled.points),
        hull,
        center_of_mass,
        BalanceOptions(),
        on_step=lambda step: on_step("balance", step),
    )
