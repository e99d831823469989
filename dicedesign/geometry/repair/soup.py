"""Triangles of any kind: how they wind around places, and their points that are closest."""

from __future__ import annotations

from typing import Any

import numpy as np

from dicedesign.errors import missing_extra
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["Soup"]


class Soup:
    """Triangles (t, 3) between points (n, 3), looked at by libigl."""

    def __init__(self, points: Floats, triangles: Integers) -> None:
        """Raises InputError without the extra `repair`."""
        try:
            import igl
        except ImportError as error:
            raise missing_extra("repair", "repair", error) from error
        self._igl: Any = igl
        self.points = np.ascontiguousarray(points, dtype=np.float64)
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int64)
        self._tree = igl.AABB()
        self._tree.init(self.points, self.triangles)

    @property
    def area(self) -> float:
        """Of all triangles."""
        return float(norms(doubled_area_vectors(self.points, self.triangles)).sum()) / 2.0

    def turns(self, places: Floats) -> Floats:
        """(k,) winding numbers around places (k, 3)."""
        queries = np.ascontiguousarray(places)
        return np.asarray(self._igl.fast_winding_number(self.points, self.triangles, queries))

    def closest(self, places: Floats) -> Floats:
        """(k, 3) the points of the triangles that are closest to places (k, 3)."""
        queries = np.ascontiguousarray(places)
        if len(queries) == 0:
            return queries
        return np.asarray(self._tree.squared_distance(self.points, self.triangles, queries)[2])

    def pieces(self, longest: float) -> Floats:
        """(p, 3, 3) corners of the triangles, cut in halves until no edge is longer than that."""
        corners, done = self.points[self.triangles], []
        while len(corners):
            lengths = norms(np.roll(corners, -1, axis=1) - corners)
            long = lengths.max(axis=1) > longest
            done.append(corners[~long])
            start = lengths[long].argmax(axis=1)
            rows = np.arange(len(start))
            a, b, c = (corners[long][rows, (start + k) % 3] for k in range(3))
            middle = (a + b) / 2.0
            corners = np.concatenate(
                [np.stack(t, axis=1) for t in ((a, middle, c), (middle, b, c))]
            )
        return np.concatenate(done)
