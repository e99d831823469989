"""Smooth displacements of the space that a surface lies in, as which it gives way.

The displacement of least work that forces on points cause is a sum of kernels about them, each
coordinate apart. The kernel is that of the biharmonic operator in space, so the work is the
integral of squared second derivatives: parts of a body that lie near each other move alike, both
sides of an ear or a leg too, which a surface that knows itself only would push through each other.

Source: Sibson and Stone, SIAM J. Sci. Stat. Comput. 12(6), 1991 (the kernel |x - y|).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky
from scipy.linalg.lapack import dpotri
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from dicedesign.errors import InputError
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface
from dicedesign.runtime.arrays import Floats, Integers, sums_by_index

FREE = 100.0
"""The constant that is added to the kernel, for a body of circumscribed radius 1: to move it as a
whole costs next to nothing, and the kernel is positive definite on it."""

HANDLES = 600
"""Points on which forces act that move the center of mass: the true ones, lumped."""


def point_masses(surface: Surface) -> Floats:
    """(n,) part of the surface's area that belongs to each point, summing to 1."""
    a, b, c = surface.points[surface.triangles].transpose(1, 0, 2)
    areas = norms(np.linalg.cross(b - a, c - a))
    masses = sums_by_index(surface.triangles.ravel(), areas.repeat(3), len(surface.points))
    return masses / masses.sum()


def positive_inverse(matrix: Floats) -> Floats:
    """Of a symmetric positive definite matrix (n, n), in half the time of any other's."""
    inverse, failed = dpotri(cholesky(matrix, lower=True), lower=1)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    upper = np.triu_indices(len(matrix), 1)
    inverse[upper] = inverse.T[upper]
    return np.asarray(inverse, dtype=np.float64)


def spread_points(points: Floats, count: int) -> Integers:
    """(count,) numbers of points (n, 3) that lie as far from each other as can be, one after the
    other; all of them where there are no more."""
    chosen = [0]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        offsets = points - points[chosen[-1]]
        nearest = np.minimum(nearest, (offsets * offsets).sum(-1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)


@dataclass(frozen=True)
class Elasticity:
    """The space about a surface.

    Attributes
    ----------
    surface: of circumscribed radius about 1.
    """

    surface: Surface

    def responses(self, points: Integers) -> Floats:
        """(n, c) displacements for a unit force on each of some points (c,)."""
        return FREE - cdist(self.surface.points, self.surface.points[points])

    @cached_property
    def _handles(self) -> tuple[Integers, Integers]:
        """Points on which forces on all are lumped, and the handle of each (n,)."""
        points = self.surface.points
        handles = spread_points(points, HANDLES)
        return handles, np.asarray(cKDTree(points[handles]).query(points)[1], dtype=np.int64)

    @cached_property
    def _by_handle(self) -> Floats:
        return self.responses(self._handles[0])

    def center_responses(self, gradient: Floats) -> Floats:
        """(n, 3, 3) displacements that move the center of mass along each axis, last, for its
        gradient (n, 3, 3)."""
        handles, owner = self._handles
        lumped = sums_by_index(owner, gradient.reshape(-1, 9), len(handles))
        return (self._by_handle @ lumped).reshape(gradient.shape)


@dataclass(frozen=True)
class HeldCorners:
    """Points of the surface that are moved to given places, and what resists it.

    Attributes
    ----------
    elasticity: of the surface.
    corners: (c,) numbers of the points, distinct.
    """

    elasticity: Elasticity
    corners: Integers

    @cached_property
    def by_corner(self) -> Floats:
        """(n, c) displacements for unit forces."""
        return self.elasticity.responses(self.corners)

    @cached_property
    def _factor(self) -> tuple[Floats, bool]:
        factor: tuple[Floats, bool] = cho_factor(self.by_corner[self.corners])
        return factor

    def followed(self, displacement: Floats) -> Floats:
        """(n, d) displacements of all points for those (c, d) of the corners."""
        return np.asarray(self.by_corner @ cho_solve(self._factor, displacement))

    def held(self, responses: Floats) -> Floats:
        """(n, d) what is left of displacements (n, d) when the corners are held in place."""
        return responses - self.followed(responses[self.corners])

    @cached_property
    def relative(self) -> tuple[Floats, Floats]:
        """Forces for displacements relative to the center of mass, (c, 3, c, 3), and how far that
        goes then, last, (c, 3, 3).

        Raises InputError where nearly all points are corners, as those of a convex surface.
        """
        gradient = np.moveaxis(self.elasticity.surface.centroid_derivatives(), 0, -1)
        by_center = self.elasticity.center_responses(gradient)
        own = np.einsum("nab,nac->bc", gradient, by_center)
        own = 0.5 * (own + own.T)
        # The true gradient tells how far forces on corners move the center.
        mixed = np.tensordot(self.by_corner, gradient, (0, 0))
        compliance = self.by_corner[self.corners][:, None, :, None] * np.eye(3)[None, :, None, :]
        compliance = compliance - mixed[:, :, None, :] - mixed.transpose(2, 0, 1)[None]
        compliance += own[None, :, None, :]
        size = 3 * len(self.corners)
        flat = compliance.reshape(size, size)
        try:
            forces = positive_inverse(0.5 * (flat + flat.T)).reshape(compliance.shape)
        except np.linalg.LinAlgError as error:
            raise InputError(
                f"surface: expected one with dents, but {len(self.corners)} of its "
                f"{len(self.elasticity.surface.points)} points are corners of its hull, and too "
                "little is left to move the center of mass with; take method exact for a convex die"
            ) from error
        return forces, np.tensordot(forces, mixed - own, 2)
