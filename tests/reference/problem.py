"""Bodies with known answers, and designs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dicedesign.runtime.arrays import Floats


@dataclass(frozen=True)
class Problem:
    """A body and known facts about its rests.

    Attributes
    ----------
    points: (n, 3) in any length unit.
    center: (3,) center of mass, or None for that of the uniform solid.
    triangles: (t, 3) corners of a mesh, or None for a point cloud.
    coplanar_tolerance: see `dicedesign.geometry.hulls.hull.convex_hull`.
    shares: (k,) exact probabilities in any order, if there is a closed form.
    rests, facets: their numbers, if known.
    symmetries: matrices (3, 3) that map body and center of mass onto themselves without rounding.
    """

    points: Floats
    center: Floats | None = None
    triangles: NDArray[np.int64] | None = None
    coplanar_tolerance: float | None = None
    shares: Floats | None = None
    rests: int | None = None
    facets: int | None = None
    symmetries: tuple[Floats, ...] = ()


def rotate_problem(problem: Problem, seed: int) -> Problem:
    """The problem in a random orientation, rounded to float64."""
    matrix = Rotation.random(random_state=seed).as_matrix()
    center = None if problem.center is None else matrix @ problem.center
    return replace(problem, points=problem.points @ matrix.T, center=center, symmetries=())


@dataclass(frozen=True)
class Case:
    """A row of a suite; see `case`.

    Attributes
    ----------
    name: unique in its suite.
    build: makes the problem.
    turns: number of random rotations in which it is also tried.
    points: rough number of points of a large problem, 0 for small ones.
    quick: whether it belongs to the short suite.
    kind: what it is summed up with.
    """

    name: str
    build: Callable[[], Any]
    turns: int = 0
    points: int = 0
    quick: bool = True
    kind: str = ""


def case(
    build: Callable[..., Any],
    *arguments: object,
    turns: int = 0,
    points: int = 0,
    quick: bool = True,
    **options: object,
) -> Case:
    """A case named after the function that makes it and its arguments."""
    values = (getattr(value, "__name__", value) for value in (*arguments, *options.values()))
    words = (f"{value:g}" if isinstance(value, float) else str(value) for value in values)
    name = " ".join([build.__name__.replace("_", " ").strip(), *words])
    return Case(name, partial(build, *arguments, **options), turns, points, quick)
