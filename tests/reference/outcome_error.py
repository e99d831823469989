"""How far the odds of outcomes are from a target, in 60-digit arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.runtime.arrays import Floats
from tests.reference.oracle import facet_polygons, oracle_probabilities
from tests.reference.sixty_digits import DIGITS, multiprecision, solid_centroid, vector

__all__ = ["exact_outcome_error"]


def exact_outcome_error(
    hull: ConvexHull, center: Floats | None, directions: Floats, target: Floats
) -> float:
    """Largest |p - q| of a die, each rest counted for the outcome whose direction is nearest.

    hull: the die; center: (3,) of mass, or None for that of the uniform solid, to 60 digits;
    directions: (k, 3) unit; target: (k,).

    Raises OracleError where the die balances exactly.
    """
    vertices, polygons = hull.vertices.tolist(), facet_polygons(hull)
    with multiprecision().workdps(DIGITS):
        middle: Any = center
        if center is None:
            middle = solid_centroid([vector(x) for x in vertices], hull.triangles.tolist())
        misses = [-vector((q, 0, 0))[0] for q in target.tolist()]
        exact = oracle_probabilities(vertices, polygons, [middle])
        for normal, probability in zip(hull.normals, exact, strict=True):
            misses[int(np.argmax(directions @ normal))] += probability
        return float(max(map(abs, misses)))
