"""Least value of a quadratic function of three variables within half-spaces."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import nnls

from dicedesign.runtime.arrays import Floats

__all__ = ["least_within"]

REGULAR: Final = 1e-9
"""Part of its trace that is added to the quadratic form: one direction may be free."""


def least_within(form: Floats, slope: Floats, normals: Floats, heights: Floats) -> Floats:
    """(3,) the point x with `normals @ x <= heights` where `x . form x / 2 + slope . x` is least.

    form: (3, 3) symmetric, not negative; slope: (3,); normals: (m, 3); heights: (m,), which leave
    a point.

    Source: Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23 (least distance
    programming by nonnegative least squares).
    """
    root = np.linalg.cholesky(form + REGULAR * np.trace(form) * np.eye(3))
    # In y = root^T x + offset the distance from the origin is to be least.
    offset = np.linalg.solve(root, slope)
    rows = -np.linalg.solve(root, normals.T)
    bounds = offset @ rows - heights
    system, wanted = np.vstack([rows, bounds]), np.eye(4)[3]
    rest = system @ nnls(system, wanted)[0] - wanted
    return np.asarray(np.linalg.solve(root.T, -rest[:3] / rest[3] - offset))
