"""The energy by which the corners of a wanted hull draw on the points of a surface that are closest
to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array, kron

from dicedesign.geometry.surfaces.distances import closest_points
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["ClosestPointEnergy"]


@dataclass(frozen=True, eq=False)
class ClosestPointEnergy:
    """`E_CP = sum_p |p - CP(p)|^2` over the corners p of a hull (eq. 28).

    CP(p) lies on a face, an edge or a corner of the surface, where it was closest; there it stays
    as the points move, so that the energy is quadratic in them.

    Attributes
    ----------
    corners: (v, 3) of the hull.
    blend: (v, n) sparse weights of the surface's points, of which CP(p) is the mean.
    """

    corners: Floats
    blend: csr_array

    @classmethod
    def of(cls, surface: Surface, corners: Floats) -> ClosestPointEnergy:
        """The energy with the closest points of a surface as it is."""
        triangles, weights = closest_points(surface, corners)
        rows = np.repeat(np.arange(len(corners)), 3)
        columns = surface.triangles[triangles].ravel()
        shape = (len(corners), len(surface.points))
        return cls(corners, csr_array((weights.ravel(), (rows, columns)), shape=shape))

    def offsets(self, points: Floats) -> Floats:
        """(v, 3) from p to CP(p), for points (n, 3) of the surface."""
        return np.asarray(self.blend @ points - self.corners)

    def value(self, points: Floats) -> float:
        """E_CP."""
        offsets = self.offsets(points)
        return float((offsets * offsets).sum())

    def gradient(self, points: Floats) -> Floats:
        """(n, 3) of E_CP."""
        return np.asarray(2.0 * (self.blend.T @ self.offsets(points)))

    @property
    def hessian(self) -> csc_array:
        """(3n, 3n) of E_CP, the same everywhere."""
        return csc_array(2.0 * kron(self.blend.T @ self.blend, eye_array(3)))
