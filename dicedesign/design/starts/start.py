"""Starting shapes: convex polyhedra with the directions on which outcomes are to be placed.

Each is made in its own coordinates, which its docstring describes, and then moved and scaled to
half extent 1; `Start` remembers how.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.runtime.arrays import Floats

__all__ = ["Start", "normalised_start"]


@dataclass(frozen=True)
class Start:
    """A shape to begin with.

    Attributes
    ----------
    points: (n, 3) whose convex hull is the shape, of half extent 1 about the middle of its box.
    directions: (k, 3) unit normals of the facets that carry outcomes, in the order in which an
        assignment names them.
    origin, scale: how the points were normalised: (3,) and a length in the shape's own
        coordinates, with point = (own - origin) / scale.
    notes: what was repaired or assumed on the way in, one sentence each.
    """

    points: Floats
    directions: Floats
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0
    notes: tuple[str, ...] = ()

    def normalised(self, own: Floats) -> Floats:
        """Points (..., 3) of the shape's own coordinates in those of `points`."""
        return (own - self.origin) / self.scale

    def about_centroid(self) -> Start:
        """The same start, moved so that its centroid is at 0."""
        centroid = convex_hull(self.points).centroid
        origin = self.origin + self.scale * centroid
        return replace(self, points=self.points - centroid, origin=origin)


def normalised_start(points: Floats, directions: Floats, notes: tuple[str, ...] = ()) -> Start:
    """A start in normalised coordinates from points (n, 3) and unit directions (k, 3)."""
    origin = (points.min(axis=0) + points.max(axis=0)) / 2.0
    centered = points - origin
    scale = float(np.abs(centered).max())
    return Start(centered / scale, directions, origin, scale, notes)
