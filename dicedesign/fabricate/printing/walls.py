"""How thin a die is under its labels.

Lengths are in millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull

if TYPE_CHECKING:
    from manifold3d import Manifold

    from dicedesign.fabricate.labels.layout import Placement

__all__ = ["walls_under"]

BENEATH: Final = -1e-2
"""Cosine between the normals of two facets below which one is beneath the other."""


class _Pocket:
    """The pocket of a label: corners (n, 3) of its floor, and a ball that holds all of it."""

    def __init__(self, placement: Placement, depth: float) -> None:
        self.placement, self.depth = placement, depth
        self.section = placement.section()
        flat = np.concatenate(self.section.to_polygons())
        frame = placement.frame
        rim = flat @ frame[:3, :2].T + frame[:3, 3]
        self.normal = frame[:3, 2]
        self.floor = rim - depth * self.normal
        self.middle = (rim.min(axis=0) + rim.max(axis=0) - depth * self.normal) / 2.0
        corners = np.concatenate([rim, self.floor])
        self.radius = float(np.linalg.norm(corners - self.middle, axis=1).max())
        self._solid: Manifold | None = None

    @property
    def solid(self) -> Manifold:
        if self._solid is None:
            cut = self.section.extrude(self.depth).translate((0.0, 0.0, -self.depth))
            self._solid = cut.transform(self.placement.frame[:3])
        return self._solid


def walls_under(
    placements: Sequence[Placement], depth: float, hull: ConvexHull
) -> tuple[float, ...]:
    """Thickness of a convex die under each of its labels: the least distance of the floor of the
    label's pocket from a facet beneath, i.e. one that looks the other way, or of the pocket from
    another.

    Both are exact: in a convex solid the distance from its facets is a concave function, least at a
    corner of the floor; that of two pockets is that of their triangles.

    placements: k labels on facets of the die; depth: of their pockets, above 0; hull: the die, in
    mm. Returns k numbers; 0 where a pocket meets another, or comes out beneath.
    """
    pockets = [_Pocket(placement, depth) for placement in placements]
    walls = []
    for pocket in pockets:
        beneath = hull.normals @ pocket.normal < BENEATH
        room = hull.depths(pocket.floor)[:, beneath]
        wall = max(float(room.min()), 0.0) if room.size else np.inf
        near = [
            (float(np.linalg.norm(pocket.middle - other.middle)) - pocket.radius - other.radius, n)
            for n, other in enumerate(pockets)
            if other is not pocket
        ]
        for least, number in sorted(near):
            if least >= wall:
                break
            wall = min(wall, float(pocket.solid.min_gap(pockets[number].solid, wall)))
        walls.append(wall)
    return tuple(walls)
