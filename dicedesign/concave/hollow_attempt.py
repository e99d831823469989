"""Ways from a surface to a concave die with a cavity, which shifts the center of mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dicedesign.balance.cavity import balancing_cavity, reach
from dicedesign.balance.regions import is_shifted
from dicedesign.concave.attempt import Attempts
from dicedesign.concave.easing import nearer_draft
from dicedesign.concave.hull_design import HullDraft
from dicedesign.concave.hull_problem import HullProblem
from dicedesign.concave.result import FilledHull, rank
from dicedesign.concave.slopes import SlopeOptions
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["HollowAttempts"]

SAFE: Final = 0.8
"""Part of the reach of cavities that is used: that of the surface as it will be bent is another."""

LESS: Final = 0.6
"""Factor of it where that was too much."""

SHIFTS: Final = 3
"""Times that the center of mass is shifted once more."""


@dataclass(frozen=True, eq=False)
class HollowAttempts(Attempts):
    """Attempts at one die with a cavity.

    Attributes
    ----------
    wall: see `make_concave_die`.
    """

    wall: float

    def filled(
        self, number: int, draft: HullDraft, slopes: SlopeOptions, best: FilledHull | None
    ) -> FilledHull | None:
        """The same, the center of mass shifted as far as cavities in the surface, as it is bent by
        then, can do that, and as bending it less is worth."""
        surface = self.problem.surface
        problem = self._with_room(surface, SAFE)
        nearer = nearer_draft(problem, draft, slopes)
        filled = self.finished(number, problem, nearer, best)
        if filled is None or not self._better_than(best, filled):
            return None
        if not self._has_room(filled):
            # A solid one to begin with, which has more room when it is bent less.
            nearer = nearer_draft(self.problem, draft, slopes)
            filled = self.finished(number, self.problem, nearer, None)
        part = SAFE
        for _ in range(SHIFTS):
            if filled is None:
                break
            bent = surface.moved((filled.points - self.center) / self.radius)
            try:
                problem = self._with_room(bent, part)
            except InputError:
                break
            further = nearer_draft(problem, nearer, slopes)
            following = self.finished(number, problem, further, filled)
            if following is None or not self._better_than(filled, following):
                break
            if self._has_room(following):
                nearer, filled = further, following
            else:
                part *= LESS
        return filled

    def _better_than(self, best: FilledHull | None, filled: FilledHull) -> bool:
        return best is None or rank(filled, self.options) < rank(best, self.options)

    def _with_room(self, surface: Surface, part: float) -> HullProblem:
        """The problem with part of the reach of cavities in a surface, in its unit."""
        return self.problem.with_room(reach(surface, self._thickness(surface), part))

    def _has_room(self, filled: FilledHull) -> bool:
        """Whether a cavity brings the center of mass to where it is wanted."""
        surface = self.surface.moved(filled.points)
        if not is_shifted(surface, filled.center_of_mass):
            return True
        try:
            balancing_cavity(surface, self._thickness(surface), filled.center_of_mass)
        except InputError:
            return False
        return True

    def _thickness(self, surface: Surface) -> float:
        """Of the walls, in the unit of a surface."""
        return self.wall * convex_hull(surface.points).diameter
