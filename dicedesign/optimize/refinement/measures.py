"""Measures of dice that thrown odds change with."""

from __future__ import annotations

import numpy as np

from dicedesign.optimize.result import DesignResult
from dicedesign.runtime.arrays import Floats

__all__ = ["shape_measures"]


def shape_measures(die: DesignResult, center: Floats | None) -> Floats:
    """(4 k,) of a die that change by little from one to the next near it: normals of the outcomes'
    facets, and logarithms of their distances from the center of mass over the mean of these.

    center: (3,) of mass, or None for the uniform solid.
    """
    hull = die.hull
    facets = np.argmax(die.directions @ hull.normals.T, axis=1)
    distances = hull.depths(hull.centroid if center is None else center)[facets]
    return np.concatenate([hull.normals[facets].ravel(), np.log(distances / distances.mean())])
