"""Derivatives of probabilities as differences of the 60-digit oracle."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from dicedesign.bench.reference.oracle import facet_polygons, oracle_probabilities
from dicedesign.bench.reference.sixty_digits import (
    DIGITS,
    Vector,
    multiprecision,
    plus,
    solid_centroid,
    times,
    vector,
)
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats

__all__ = ["oracle_derivative"]

STEP: Final = "1e-20"
"""Part of the displacement that is taken to both sides: the difference quotient is off by about its
square, and by the oracle's 1e-60 over it."""


def oracle_derivative(
    hull: ConvexHull, center: Floats | None, along: Floats, center_along: Floats
) -> Floats:
    """Derivative (m,) of the probability of each facet, right to all digits of float64.

    The facets stay those of the hull, as they do for any displacement small enough.

    hull: of triangles only if corners move, as others do not stay flat.
    center: (3,) center of mass, or None for that of the uniform solid, which then moves as the
        corners make it.
    along: (n, 3) velocity of each corner.
    center_along: (3,) that of a given center; without meaning for a uniform one.

    Raises OracleError where the body balances exactly.
    """
    if len(hull.triangles) != len(hull.normals) and along.any():
        raise ValueError("oracle_derivative: expected corners at rest or a hull of triangles only")
    mp = multiprecision()
    triangles = hull.triangles.tolist()
    polygons = facet_polygons(hull)
    with mp.workdps(DIGITS):
        step = mp.mpf(STEP)
        sides = []
        for move in (step, -step):
            moved = [_moved(x, v, move) for x, v in zip(hull.vertices, along, strict=True)]
            middle = (
                solid_centroid(moved, triangles)
                if center is None
                else _moved(center, center_along, move)
            )
            sides.append(oracle_probabilities(moved, polygons, [middle]))
        return np.array([float((p - q) / (2 * step)) for p, q in zip(*sides, strict=True)])


def _moved(x: Floats, velocity: Floats, time: Any) -> Vector:
    return plus(vector(x.tolist()), times(time, vector(velocity.tolist())))
