"""A closed surface whose solid is to become a die."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dicedesign.geometry.solid import centroid_derivatives, solid_properties
from dicedesign.runtime.arrays import Floats, Integers


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed triangle surface, oriented outward, of one solid body.

    Attributes
    ----------
    points: (n, 3) in any length unit, each used by a triangle.
    triangles: (t, 3) counter-clockwise seen from outside.
    """

    points: Floats
    triangles: Integers

    @cached_property
    def _properties(self) -> tuple[float, Floats]:
        return solid_properties(self.points, self.triangles)

    @property
    def volume(self) -> float:
        """Of the uniform solid, in cubed length units."""
        return self._properties[0]

    @property
    def centroid(self) -> Floats:
        """(3,) center of mass of the uniform solid."""
        return self._properties[1]

    @cached_property
    def diagonal(self) -> float:
        """Length of the diagonal of the box along the axes that holds the surface."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def centroid_derivatives(self) -> Floats:
        """(3, n, 3) of each coordinate of the centroid by each coordinate of the points."""
        return centroid_derivatives(self.points, self.triangles, self.centroid)

    def moved(self, points: Floats) -> Surface:
        """The same triangles between other points (n, 3)."""
        return Surface(points, self.triangles)


def surface_of(points: Floats, triangles: Integers) -> Surface:
    """The surface of triangles (t, 3) alone: of the points (n, 3) those that they use."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    return Surface(points[used], renumbered.reshape(-1, 3))


def joined(first: Surface, second: Surface) -> Surface:
    """Two surfaces as one, of which neither changes."""
    return Surface(
        np.concatenate([first.points, second.points]),
        np.concatenate([first.triangles, second.triangles + len(first.points)]),
    )
