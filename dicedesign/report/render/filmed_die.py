"""A filmed throw of a die on its table, ready to be drawn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.report.render.raster import Camera
from dicedesign.report.render.tabletop import Tabletop
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from dicedesign.fabricate.die import FinishedDie
    from dicedesign.throws.film import Film

__all__ = ["MARGIN", "FilmedDie", "can_be_filmed", "filmed"]

MARGIN: Final = 1.2
"""Room around the die in pictures, over its extent."""


@dataclass(frozen=True, eq=False)
class FilmedDie:
    """A throw, and the solid to draw in it.

    Attributes
    ----------
    film: of the throw.
    points: (n, 3) of the solid, labels cut in or not, in the frame and unit of length of the body
        that was filmed; triangles: (t, 3).
    center_of_mass: (3,) that the body was thrown with, in the same.
    """

    film: Film
    points: Floats
    triangles: Integers
    center_of_mass: Floats

    @property
    def radius(self) -> float:
        """Of the die on its table, in m."""
        return self.film.table.size / 2.0

    def travel(self) -> Floats:
        """The level unit direction (3,) from the throw's start to its end."""
        positions = self.film.positions
        way = (positions[-1] - positions[0]) * [1.0, 1.0, 0.0]
        length = float(np.linalg.norm(way))
        # One that goes nowhere may do so in any direction.
        return way / length if length > self.radius else np.array([1.0, 0.0, 0.0])

    def placed(self, frame: int) -> Floats:
        """Points (n, 3) of the solid in a frame, in m."""
        return self.film.placed(self.points, self.center_of_mass, frame)

    def reach(self, middles: Floats, tabletop: Tabletop, camera: Camera) -> tuple[float, float]:
        """How far below and above the table's middle (3,), or (f, 3) in each frame, a picture of
        the film reaches."""
        heights = (self.film.positions - middles) @ camera.frame()[1]
        margin = MARGIN * tabletop.radius
        return min(float(heights.min()) - margin, -tabletop.drop), float(heights.max()) + margin


def can_be_filmed(die: FinishedDie) -> bool:
    """Whether a die is thrown, as a mesh, where the package's own simulator is there."""
    from dicedesign.kernels import ops as kernels

    thrown = die.thrown
    has_mesh = thrown is not None and thrown.die.solid.triangles is not None
    return has_mesh and kernels.available()


@lru_cache(maxsize=1)
def filmed(die: FinishedDie) -> FilmedDie:
    """A typical throw of a die that can be filmed."""
    from dicedesign.throws.film import throw_film

    assert die.thrown is not None
    thrown = die.thrown.die
    assert thrown.solid.triangles is not None
    film = throw_film(thrown.body, thrown.table)
    center = thrown.poses.center_of_mass
    return FilmedDie(film, thrown.solid.points, thrown.solid.triangles, center)
