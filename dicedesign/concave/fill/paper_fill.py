"""A designed hull filled as in the paper (appendix B): quadratic programs, then the center of
mass."""

from __future__ import annotations

from collections.abc import Callable

from dicedesign.concave.fill.balance import balance
from dicedesign.concave.fill.paper_options import ConcavePaperOptions
from dicedesign.concave.fill.quadratic_fill import fill_by_quadratic_programs
from dicedesign.concave.fill.result import FillResult, FillStatus
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["fill_as_paper"]


def fill_as_paper(
    surface: Surface,
    hull: ConvexHull,
    center_of_mass: Floats,
    options: ConcavePaperOptions,
    on_step: Callable[[str, float], None],
) -> FillResult:
    """The surface grown in a wanted hull, and its center of mass brought to where it is wanted (3,)
    while the hull that it has then stays.

    on_step: called with "fill" or "balance" and the energy of every step. The status is that of the
    balance, or UNSOLVED where there is nothing to balance.

    Raises InputError where Clarabel is not installed or a triangle has no area.
    """
    filled = fill_by_quadratic_programs(
        surface, hull, options, lambda energy: on_step("fill", energy)
    )
    if filled.status is FillStatus.UNSOLVED:
        return filled
    return balance(
        surface,
        surface.moved(filled.points),
        convex_hull(filled.points),
        center_of_mass,
        options,
        lambda energy: on_step("balance", energy),
    )
