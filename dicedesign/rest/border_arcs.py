"""Great arcs that borders of basins are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dicedesign.geometry.sphere import norms, unit_vectors
from dicedesign.rest.basins import Basins
from dicedesign.rest.morse import Separatrices
from dicedesign.runtime.arrays import Booleans, Floats, Integers


@dataclass(frozen=True, eq=False)
class Arcs:
    """Great arcs, each shorter than pi and none of length zero.

    Attributes
    ----------
    start: (n, 3) unit directions where they begin; toward: (n, 3) unit tangents there.
    pole: (n, 3) unit normals of their planes, to the left of travel.
    length: (n,) in radians.
    """

    start: Floats
    toward: Floats
    pole: Floats
    length: Floats

    @classmethod
    def between(cls, a: Floats, b: Floats) -> Arcs:
        """Those from unit directions a (n, 3) to b (n, 3), neither equal nor opposite."""
        across = np.linalg.cross(a, b)
        sine = norms(across)
        pole = across / sine[:, None]
        toward = np.asarray(np.linalg.cross(pole, a), dtype=np.float64)
        return cls(a, toward, pole, np.asarray(np.arctan2(sine, (a * b).sum(-1))))

    def at(self, rows: Integers, distance: Floats) -> Floats:
        """(r, m, 3) unit directions on the arcs `rows` (r,) at distances (r, m) from their
        starts."""
        start, toward = self.start[rows, None, :], self.toward[rows, None, :]
        return np.cos(distance)[..., None] * start + np.sin(distance)[..., None] * toward

    def speeds(self, rows: Integers, distance: Floats) -> Floats:
        """(r, m, 2) how fast the arcs `rows` (r,) move aside at distances (r, m) from their starts
        when the start, or the end, does so at speed 1 and the other stays."""
        length = self.length[rows, None]
        ends = np.stack([np.sin(length - distance), np.sin(distance)], axis=-1)
        return np.asarray(ends / np.sin(length)[..., None])

    def nearest(self, axis: Floats) -> Floats:
        """(n,) distance, in (-pi, pi], from the start to the point of the great circle that is
        nearest to an axis (3,)."""
        return np.asarray(np.arctan2(self.toward @ axis, self.start @ axis))


@dataclass(frozen=True, eq=False)
class Borders:
    """The arcs of all separatrices of a body.

    Attributes
    ----------
    paths: the separatrices; lengths: (2 s, depth + 2) of the vectors to their points.
    moving: (2 s, depth + 1) where a branch goes on, in whose order the n arcs are.
    arcs: all that go on.
    """

    paths: Separatrices
    lengths: Floats
    moving: Booleans
    arcs: Arcs

    @classmethod
    def of(cls, paths: Separatrices, points: Floats) -> Borders:
        """Those through points (2 s, depth + 2, 3), see `separatrix_points`."""
        unit = unit_vectors(points)
        a, b = unit[:, :-1], unit[:, 1:]
        moving = norms(np.linalg.cross(a, b)) > 0.0
        return cls(paths, norms(points), moving, Arcs.between(a[moving], b[moving]))

    @classmethod
    def of_basins(cls, basins: Basins) -> Borders:
        """Those of a body's basins."""
        return cls.of(basins.paths, basins.points)

    def sums(self, values: Floats) -> Floats:
        """(k,) sums of values (n,) of the arcs over the borders of the basins, each arc with the
        basin to its left, and with the other sign for the basin to its right."""
        of_branch = self._by_branch(values)
        across = of_branch[::2] - of_branch[1::2]
        return self._by_basin(across, -across)

    def totals(self, values: Floats) -> Floats:
        """(k,) the same sums without signs."""
        of_branch = self._by_branch(values)
        across = of_branch[::2] + of_branch[1::2]
        return self._by_basin(across, across)

    def _by_branch(self, values: Floats) -> Floats:
        filled = np.zeros(self.moving.shape)
        filled[self.moving] = values
        return np.asarray(filled.sum(axis=1))

    def _by_basin(self, left: Floats, right: Floats) -> Floats:
        sums = np.zeros(len(self.paths.rests))
        np.add.at(sums, self.paths.basins[:, 0], left)
        np.add.at(sums, self.paths.basins[:, 1], right)
        return sums

    def point_slopes(self, fluxes: Floats) -> Floats:
        """(2 s, depth + 2, 3) derivatives of what is to the left of each branch in the points on
        it, for fluxes (n, 2) over the arcs, see `DensityPrior`."""
        slopes = np.zeros((*self.lengths.shape, 3))
        # To the right of travel what is on the left gains.
        outward = -self.arcs.pole
        for column, ends in ((0, slopes[:, :-1]), (1, slopes[:, 1:])):
            moved = np.zeros(ends.shape)
            moved[self.moving] = fluxes[:, column, None] * outward
            ends += moved
        return np.asarray(slopes / self.lengths[..., None])
