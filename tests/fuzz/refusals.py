"""Whether a body may be refused, decided without the product."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from scipy.spatial import ConvexHull as Triangulation
from scipy.spatial import QhullError

from dicedesign.rest.basins import TIE_STEP
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import (
    BOUNDARY_TOLERANCE,
    COPLANAR_TOLERANCE,
    TIE_TOLERANCE,
)
from tests.reference.problem import Problem

MARGIN = 4.0
"""Tolerances within which a body near refusal may be refused."""


def thickness(points: Floats) -> float:
    """Height of a large tetrahedron of points over half their extent: 0 exactly where they lie on
    a plane, else at most the least width of the body and not much less."""
    exact = np.frompyfunc(Fraction, 1, 1)(np.unique(points, axis=0))
    local = exact - exact[0]
    a = local[(local**2).sum(axis=1).argmax()]
    across = np.cross(a, local)
    normal = across[(across**2).sum(axis=1).argmax()]
    if not any(normal):
        return 0.0
    height = abs(local @ normal).max()
    extent = float(np.ptp(points, axis=0).max()) / 2.0
    return float(height) / (float(normal @ normal) ** 0.5 * extent)


def may_be_refused(problem: Problem) -> bool:
    """Whether a body may be refused: too flat, or its center of mass not inside."""
    return may_be_too_flat(problem) or may_be_outside(problem)


def may_be_too_flat(problem: Problem) -> bool:
    """Whether the points span no volume to within the coplanar tolerance."""
    return thickness(problem.points) <= MARGIN * _tolerance(problem)


def may_be_outside(problem: Problem) -> bool:
    """Whether the given center of mass is on the hull's boundary or beyond, to within the tolerance
    by which facets are flat, or so near that the move of a tied body's puts it there."""
    if problem.center is None:
        # So thin and so far from the origin that rounding alone moves the center out.
        extent = float(np.ptp(problem.points, axis=0).max())
        far = float(np.abs(problem.points).max()) / extent
        return thickness(problem.points) <= 64.0 * float(np.finfo(np.float64).eps) * far
    local = problem.points - problem.center
    scale = float(np.ptp(local, axis=0).max()) / 2.0
    try:
        planes = np.unique(Triangulation(local / scale).equations, axis=0)
    except (QhullError, ValueError):
        return True
    depth = -float(planes[:, 3].max())
    gaps = np.abs(local / scale @ planes[:, :3].T + planes[:, 3])
    # How far points lie off the facets to which they may be counted.
    uneven = gaps[gaps <= _tolerance(problem)].max()
    far = float(np.abs(problem.points).max()) / scale
    move = TIE_STEP * TIE_TOLERANCE * (2.0 + far)
    return depth <= move + MARGIN * (BOUNDARY_TOLERANCE + float(uneven))


def _tolerance(problem: Problem) -> float:
    """Coplanar tolerance over half the extent, with the rounding of points far away."""
    tolerance = problem.coplanar_tolerance
    if tolerance == 0.0:
        return float(np.finfo(np.float64).eps)
    scale = float(np.ptp(problem.points, axis=0).max()) / 2.0
    far = float(np.abs(problem.points).max()) / scale
    chosen = COPLANAR_TOLERANCE if tolerance is None else tolerance
    return float(chosen + 4.0 * np.finfo(np.float64).eps * far)
