"""Bodies that carry their answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

__all__ = ["Case", "Problem", "turned"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Problem:
    """A body and what is known about its rests.

    Attributes
    ----------
    points: (n, 3) in any length unit.
    center: (3,) center of mass, or None for that of the uniform solid.
    triangles: (t, 3) corners of a mesh, or None for a point cloud.
    coplanar_tolerance: see `dicedesign.geometry.hull.convex_hull`.
    shares: (k,) exact probabilities in any order, where a closed form is known.
    rests: number of rests, where it is known.
    symmetries: matrices (3, 3) that map body and center of mass to themselves without rounding.
    """

    points: Floats
    center: Floats | None = None
    triangles: NDArray[np.int64] | None = None
    coplanar_tolerance: float | None = None
    shares: Floats | None = None
    rests: int | None = None
    symmetries: tuple[Floats, ...] = ()


@dataclass(frozen=True)
class Case:
    """A row of a suite.

    Attributes
    ----------
    name: unique in its suite.
    build: makes the problem.
    turns: under how many random rotations it is tried as well.
    points: rough number of points of a large problem, 0 for small ones.
    quick: whether it belongs to the short suite too.
    """

    name: str
    build: Callable[[], Problem]
    turns: int = 0
    points: int = 0
    quick: bool = True


def turned(problem: Problem, seed: int) -> Problem:
    """The problem in a random orientation, rounded to float64."""
    matrix = Rotation.random(random_state=seed).as_matrix()
    center = None if problem.center is None else matrix @ problem.center
    return replace(problem, points=problem.points @ matrix.T, center=center, symmetries=())
