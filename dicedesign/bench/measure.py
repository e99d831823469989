"""One body: its probabilities, and how wrong they are by every measure there is."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dicedesign.bench.condition import condition
from dicedesign.bench.oracle import hull_probabilities
from dicedesign.bench.problem import Problem
from dicedesign.geometry.body import make_body
from dicedesign.geometry.hull import ConvexHull
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.probabilities import find_basins

__all__ = ["ORACLE_FACETS", "Measurement", "measure"]

Floats = NDArray[np.float64]

ORACLE_FACETS: Final = 2000
"""Hulls of up to so many facets are held against the oracle."""

HULL_CHECK_PAIRS: Final = 4_000_000
"""Up to so many pairs of a point and a facet it is checked that the hull contains the points."""


@dataclass(frozen=True)
class Measurement:
    """How a body came out.

    Attributes
    ----------
    facets: of the hull.
    rests: how many.
    probabilities: (k,) in descending order.
    excess: their sum less 1.
    errors: largest error of a probability by measure: "oracle", "closed form", "symmetry".
    condition: see `dicedesign.bench.condition`.
    outside: how far a point lies beyond a facet's plane, more than rounding far from the origin
        explains, over half the body's extent; NaN where that was too much to look at.
    seconds: wall-clock time of the query.
    tied: whether its center of mass was moved to both sides of a balance.
    """

    facets: int
    rests: int
    probabilities: tuple[float, ...]
    excess: float
    errors: dict[str, float]
    condition: float
    outside: float
    seconds: float
    tied: bool


def measure(problem: Problem, *, oracle: bool = True) -> Measurement:
    """Ask the product for a problem's rests and compare. Raises as `rest_poses`.

    oracle: whether a small hull is held against the oracle.
    """
    body = make_body(problem.points, problem.triangles)
    started = time.perf_counter()
    poses = rest_poses(body, problem.center, coplanar_tolerance=problem.coplanar_tolerance)
    seconds = time.perf_counter() - started
    hull = poses.hull
    sides = find_basins(hull, poses.center_of_mass)
    errors = {}
    if problem.shares is not None:
        errors["closed form"] = share_error(problem.shares, poses.probabilities)
    if problem.symmetries:
        errors["symmetry"] = max(_asymmetry(poses, matrix) for matrix in problem.symmetries)
    if oracle and len(hull.normals) <= ORACLE_FACETS:
        centers = [side.equilibria.center_of_mass for side in sides]
        errors["oracle"] = _oracle_error(poses, centers)
    return Measurement(
        facets=len(hull.normals),
        rests=len(poses.probabilities),
        probabilities=tuple(poses.probabilities.tolist()),
        excess=float(poses.probabilities.sum()) - 1.0,
        errors=errors,
        condition=max(condition(hull, s.equilibria.center_of_mass, s.paths) for s in sides),
        outside=_outside(hull, body.points, poses.center_of_mass),
        seconds=seconds,
        tied=len(sides) > 1,
    )


def share_error(expected: Floats, found: Floats) -> float:
    """Largest difference of probabilities (k,) and (l,) in order of size; missing ones are 0."""
    both = np.zeros((2, max(len(expected), len(found))))
    for row, values in zip(both, (expected, found), strict=True):
        row[: len(values)] = np.sort(values)[::-1]
    return float(np.abs(both[0] - both[1]).max())


def _oracle_error(poses: RestPoses, centers: list[Floats]) -> float:
    exact = hull_probabilities(poses.hull, centers)
    found = np.zeros(len(exact))
    found[poses.facets] = poses.probabilities
    return max(abs(float(p - q)) for p, q in zip(exact, found.tolist(), strict=True))


def _asymmetry(poses: RestPoses, matrix: Floats) -> float:
    image = cKDTree(poses.normals).query(poses.normals @ matrix.T)[1]
    return float(np.abs(poses.probabilities - poses.probabilities[image]).max())


def _outside(hull: ConvexHull, points: Floats, center: Floats) -> float:
    if len(points) * len(hull.normals) > HULL_CHECK_PAIRS:
        return float("nan")
    local = points - center
    scale = float(np.ptp(hull.vertices - center, axis=0).max()) / 2.0
    beyond = (local @ hull.normals.T - hull.heights(center)).max(axis=0)
    # A facet's plane is known the less the more slender the facet is.
    rounding = 4.0 * float(np.finfo(np.float64).eps * np.abs(points).max())
    return float((beyond - rounding * (1.0 + scale * scale / hull.areas)).max()) / scale
