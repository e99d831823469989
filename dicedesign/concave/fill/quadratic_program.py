"""Quadratic programs for points that move least uphill and stay inside a convex polyhedron."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_array, csc_matrix, triu

from dicedesign.errors import missing_extra
from dicedesign.runtime.arrays import Booleans, Floats

__all__ = ["PointsInside", "solve_quadratic_program"]

ALMOST: Final = 0.999
"""Part of the largest size inside that points get which are put there."""

NEAR: Final = 0.05
"""Half-spaces nearer to a point than this, in units of length of the program, are among the first
that it is kept in."""

NEAREST: Final = 4
"""Most half-spaces of each point among the first."""

WORST: Final = 2
"""Most half-spaces of each point that are added at a time."""

ROUNDS: Final = 6
"""Most programs for one step."""

OUTSIDE: Final = 5e-4
"""Distance beyond a half-space, in the same units, from which on it is added. What is less is
mended when the step is done, and kept to from the next one on."""


def solve_quadratic_program(
    hessian: csc_array, gradient: Floats, rows: csc_array, bounds: Floats
) -> Floats | None:
    """The x that minimises `x . H x / 2 + g . x` where `A x <= b`, or None where none was found.

    Parameters
    ----------
    hessian: (n, n) H, symmetric positive semidefinite.
    gradient: (n,) g.
    rows: (m, n) A.
    bounds: (m,) b.

    Raises
    ------
    InputError: Clarabel is not installed.
    """
    try:
        import clarabel
    except ImportError as error:
        raise missing_extra("concave", "hull fill by quadratic programs", error) from error
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.NonnegativeConeT(len(bounds))]
    solution = clarabel.DefaultSolver(
        csc_matrix(triu(hessian, format="csc")), gradient, csc_matrix(rows), bounds, cones, settings
    ).solve()
    minimum = np.array(solution.x)
    solved = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
    return minimum if solution.status in solved and bool(np.isfinite(minimum).all()) else None


class PointsInside:
    """Points that move inside a polyhedron about the origin, `normals . x <= heights`.

    A program has constraints only for half-spaces near each point; those that its solution violates
    are added until there are none. The ones that held a point back at the end of a step are among
    the first of the next.
    """

    def __init__(self, normals: Floats, heights: Floats) -> None:
        """normals: (m, 3) unit; heights: (m,) above 0."""
        self.normals = normals
        self.heights = heights
        self.held: Booleans | bool = False

    def slacks(self, points: Floats) -> Floats:
        """(n, m) distances of points (n, 3) from the planes, positive inside."""
        return self.heights - points @ self.normals.T

    def largest(self, points: Floats) -> Floats:
        """Points (n, 3) moved, and scaled down where they have to be, to the largest size that is
        inside."""
        reaches = (points @ self.normals.T).max(axis=0)
        # Of the size s and the shift t, the largest s with s * reach + normal . t <= height.
        best = linprog(
            [-1.0, 0.0, 0.0, 0.0],
            np.column_stack([reaches, self.normals]),
            self.heights,
            bounds=[(0.0, 1.0), *[(None, None)] * 3],
        ).x
        return ALMOST * (best[0] * points + best[1:])

    def mended(self, points: Floats) -> Floats:
        """Points (n, 3), those outside drawn toward the origin until they are not."""
        excess = (points @ self.normals.T / self.heights).max(axis=1)
        return points / np.maximum(excess, 1.0)[:, None]

    def step(self, points: Floats, hessian: csc_array, gradient: Floats) -> Floats | None:
        """Moves d (n, 3) that minimise `d . H d / 2 + g . d` with all points inside; None where the
        program cannot be solved.

        points: (n, 3), inside; hessian: (3n, 3n) H, symmetric positive semidefinite; gradient:
        (n, 3) g.
        """
        slacks = self.slacks(points)
        pairs = np.full(slacks.shape, self.held)
        _add_least(pairs, slacks, NEAREST, NEAR)
        for _ in range(ROUNDS):
            point, plane = np.nonzero(pairs)
            entries = (3 * point[:, None] + np.arange(3)).ravel()
            rows = csc_array(
                (self.normals[plane].ravel(), (np.repeat(np.arange(len(point)), 3), entries)),
                shape=(len(point), points.size),
            )
            minimum = solve_quadratic_program(hessian, gradient.ravel(), rows, slacks[point, plane])
            if minimum is None:
                return None
            moves = minimum.reshape(-1, 3)
            left = slacks - moves @ self.normals.T
            if not _add_least(pairs, left, WORST, -OUTSIDE):
                break
        self.held = pairs & (left < OUTSIDE)
        return moves


def _add_least(pairs: Booleans, slacks: Floats, count: int, limit: float) -> bool:
    """Mark the least of each row of slacks (n, m), at most `count` and only those below a limit, in
    pairs (n, m); whether there were any."""
    count = min(count, slacks.shape[1] - 1)
    least = np.argpartition(slacks, count, axis=1)[:, :count]
    rows, columns = np.nonzero(np.take_along_axis(slacks, least, axis=1) < limit)
    pairs[rows, least[rows, columns]] = True
    return len(rows) > 0
