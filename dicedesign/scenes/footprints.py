"""What bodies cover on the floor: convex polygons, and whether two of them are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.runtime.arrays import Floats

__all__ = ["Footprint", "gap"]


@dataclass(frozen=True, eq=False)
class Footprint:
    """A convex polygon.

    Attributes
    ----------
    corners: (m, 2), counter-clockwise.
    outward: (e, 2) outward unit normals of its edges.
    reach: (e,) how far it reaches along them.
    """

    corners: Floats
    outward: Floats
    reach: Floats

    @classmethod
    def under(cls, points: Floats) -> Footprint:
        """The convex hull of points (n, 2) that are not all on one line."""
        corners = _hull(points)
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(edges[:, 0], edges[:, 1])[:, None]
        outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths
        # Beyond all corners, not just the edge's own: the shortest edges have any direction.
        return cls(corners, outward, (corners @ outward.T).max(axis=0))

    @property
    def area(self) -> float:
        x, y = (self.corners - self.corners[0]).T
        return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0

    def room_around(self, point: Floats) -> float:
        """Radius of the largest disc around a point (2,) inside; 0 for a point outside."""
        return max(float((self.reach - self.outward @ point).min()), 0.0)


def gap(one: Footprint, other: Footprint, shift: Floats) -> float:
    """The widest strip beside an edge of one of two footprints, the other of them shifted by (2,),
    that has them on different sides; 0 or less where they meet.

    Convex polygons that do not meet always have such a strip beside one of their edges.
    """
    beside_one = (other.corners @ one.outward.T).min(axis=0) + one.outward @ shift - one.reach
    beside_other = (one.corners @ other.outward.T).min(axis=0) - other.outward @ shift - other.reach
    return float(max(beside_one.max(), beside_other.max()))


def _hull(points: Floats) -> Floats:
    """Corners (m, 2) of the convex hull of points (n, 2), counter-clockwise.

    Source: A. M. Andrew, Inf. Process. Lett. 9(5), 1979 (the monotone chain).
    """
    ordered = np.unique(points, axis=0).tolist()
    chains: list[list[list[float]]] = []
    for row in (ordered, ordered[::-1]):
        chain: list[list[float]] = []
        for x, y in row:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2], chain[-1]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0.0:
                    break
                chain.pop()
            chain.append([x, y])
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])
