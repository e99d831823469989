"""Sobolev preconditioning: gradients spread over the surface before a step is taken."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.optimize.options import SobolevOptions
from dicedesign.runtime.arrays import Floats, Integers

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import SuperLU


def graph_laplacian(hull: ConvexHull) -> csc_array:
    """(n, n) Laplacian L of the hull's edge graph: degree on the diagonal, -1 for each edge."""
    return edge_laplacian(hull.tail, hull.head, len(hull.vertices))


def edge_laplacian(tails: Integers, heads: Integers, size: int) -> csc_array:
    """(size, size) the same of any graph, whose edges (h,) are given in both directions."""
    # It takes longer to load than most dice to design, which need none.
    from scipy.sparse import csc_array, diags_array

    adjacency = csc_array((np.ones(len(tails)), (tails, heads)), shape=(size, size))
    return csc_array(diags_array(np.asarray(adjacency.sum(axis=0)).ravel()) - adjacency)


@dataclass(frozen=True)
class SobolevSolver:
    """`(I + lambda L)^-p` with its factor, good for as long as the hull's edges stay the same.

    Attributes
    ----------
    laplacian: (n, n) symmetric positive semidefinite.
    options: lambda and p.
    """

    laplacian: csc_array
    options: SobolevOptions

    @cached_property
    def _factor(self) -> SuperLU:
        from scipy.sparse import csc_array, eye_array
        from scipy.sparse.linalg import splu

        size = self.laplacian.shape[0]
        return splu(csc_array(eye_array(size) + self.options.smoothing * self.laplacian))

    def solve(self, gradient: Floats) -> Floats:
        """Apply the operator to (n, d) right-hand sides."""
        for _ in range(self.options.power):
            gradient = self._factor.solve(gradient)
        return gradient


@dataclass
class SobolevGradient:
    """Gradients in vertices, made smooth over the hull; it keeps the factor of the last hull.

    Attributes
    ----------
    options: of the operator, or None to leave gradients as they are.
    drift: whether the mean of the hull's vertices may move.
    """

    options: SobolevOptions | None
    drift: bool = True
    _last: tuple[ConvexHull, SobolevSolver] | None = field(default=None, init=False)

    def of(self, gradient: Floats, hull: ConvexHull) -> Floats:
        """The gradient (3 n,) in points, of which the hull has its vertices, after the operator;
        that of points inside stays 0."""
        if self.options is None and self.drift:
            return gradient
        spread = gradient.reshape(-1, 3)[hull.source]
        if self.options is not None:
            spread = self._solver(hull, self.options).solve(spread)
        if not self.drift:
            spread = spread - spread.mean(axis=0)
        smooth = np.zeros((len(gradient) // 3, 3))
        smooth[hull.source] = spread
        return smooth.ravel()

    def _solver(self, hull: ConvexHull, options: SobolevOptions) -> SobolevSolver:
        if self._last is None or not _same_edges(self._last[0], hull):
            self._last = hull, SobolevSolver(graph_laplacian(hull), options)
        return self._last[1]


def _same_edges(a: ConvexHull, b: ConvexHull) -> bool:
    return (
        len(a.tail) == len(b.tail)
        and len(a.vertices) == len(b.vertices)
        and bool((a.tail == b.tail).all() and (a.twin == b.twin).all())
    )
