"""Ways from rest to rest as integers.

A transition leads from one rest over a saddle to another; every dividing saddle is two, there and
back. Two transitions in a row, the second of which leaves the rest that the first leads to, are a
carry.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.morse import Separatrices
from dicedesign.runtime.arrays import Booleans, Floats, Integers, ragged_ranges

__all__ = ["Transitions"]


@dataclass(frozen=True)
class Transitions:
    """The transitions and carries of a body, as integers.

    Attributes
    ----------
    corners: (k, c) vertices of each rest's facet, counter-clockwise seen from outside; after the
        last comes the first again.
    real: (k, c) whether an edge begins at each of them.
    tail, head: (m,) ends of the edge of each transition's saddle.
    source, target: (m,) rest that each transition leaves, and leads to.
    first, second: (t,) the transitions of each carry.
    """

    corners: Integers
    real: Booleans
    tail: Integers
    head: Integers
    source: Integers
    target: Integers
    first: Integers
    second: Integers

    @classmethod
    def of(cls, hull: ConvexHull, paths: Separatrices) -> Transitions:
        """Those of a hull with its separatrices; rests are numbered as in `paths.rests`."""
        start, end = hull.facet_start[paths.rests], hull.facet_start[paths.rests + 1]
        counts = end - start
        corners = np.repeat(hull.tail[start][:, None], int(counts.max()), axis=1)
        owner, half_edges = ragged_ranges(start, counts)
        corners[owner, half_edges - start[owner]] = hull.tail[half_edges]
        real = np.arange(corners.shape[1]) < counts[:, None]
        tail, head = np.concatenate([paths.saddle_ends, paths.saddle_ends]).T
        source, target = np.concatenate([paths.basins, paths.basins[:, ::-1]]).T
        saddle = np.tile(np.arange(len(paths.basins)), 2)
        first, second = np.nonzero((target[:, None] == source) & (saddle[:, None] != saddle))
        return cls(corners, real, tail, head, source, target, first, second)

    @property
    def rests(self) -> int:
        """Number of rests."""
        return len(self.corners)

    @cached_property
    def is_return(self) -> Floats:
        """(t,) 1 for carries back to the rest that they came from."""
        return (self.source[self.first] == self.target[self.second]).astype(np.float64)
