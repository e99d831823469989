"""A designed hull filled as in the paper: quadratic programs, then the center of mass."""

from __future__ import annotations

from collections.abc import Callable

from dicedesign.concave.fill.balance import balance
from dicedesign.concave.fill.quadratic_fill import fill_by_quadratic_programs
from dicedesign.concave.fill.result import FillResult
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["fill"]


def fill(
    surface: Surface,
    hull: ConvexHull,
    corners: Integers,
    center_of_mass: Floats,
    on_step: Callable[[str, float], None],
) -> FillResult:
    """Appendix B of the paper, from the original surface, with known corners.

    corners: (v,) distinct numbers of the points that become the hull's; center_of_mass: (3,)
    wanted, inside the hull; on_step: called with "fill" or "balance" and the energy of every step.
    The status is that of the balance.

    Raises InputError where Clarabel is not installed or a triangle has no area.
    """
    filled = fill_by_quadratic_programs(
        surface, hull, corners, center_of_mass, lambda energy: on_step("fill", energy)
    )
    inside = surface.moved(filled.points)
    return balance(surface, inside, hull, center_of_mass, lambda energy: on_step("balance", energy))
