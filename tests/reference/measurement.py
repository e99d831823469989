"""Measurement of the rests of a body, with their errors by all known measures, and the verdict."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import mpmath
import numpy as np
from scipy.spatial import cKDTree

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, consistent_winding, make_body
from dicedesign.geometry.sphere import norms
from dicedesign.rest.basins import Basins, merged_rests
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from tests.reference.oracle import DIGITS, exact, hull_probabilities, solid_centroid
from tests.reference.oracle_derivatives import probability_condition
from tests.reference.problem import Problem

OK = "ok"

ERROR_LIMIT = 1e-12
"""Tolerance on a probability and on the sum of all."""

CONDITION_FACTOR = 100.0
"""Tolerance on larger errors, in units of the condition times machine epsilon."""

OUTSIDE_LIMIT = 1e-10
"""Tolerance on the distance of a point outside of the hull, over half its extent."""

ORACLE_FACETS = 2000
"""Largest number of facets of a hull that is compared with the oracle."""

ULPS = 32.0
"""Tolerance on centers of mass, in roundings of the largest coordinate."""

FAR = 10.0
"""Distance from the origin, over the extent of a body, above which coordinates have lost digits."""

SIDES = 4
"""Limit on the bodies beside a tied body that are compared with the oracle and have a condition."""

HULL_CHECK_PAIRS = 4_000_000
"""Largest number of pairs of a point and a facet for which the points are checked to be inside."""


@dataclass(frozen=True)
class Measurement:
    """Measurement of the rests of a body.

    Attributes
    ----------
    facets: number of facets of the hull.
    rests: number of rests.
    probabilities: (k,) in descending order.
    excess: sum of the probabilities minus 1.
    errors: largest error of a probability by measure: "oracle", "closed form", "symmetry". outside:
        largest distance of a point beyond the plane of a facet, minus the rounding far from the
        origin, over half the extent of the body; NaN if there are too many pairs.
    seconds: wall-clock time of the query.
    tied: whether the center of mass was moved to both sides of a balance.
    hull, centers: classified hull and centers of mass of the condition.
    """

    facets: int
    rests: int
    probabilities: tuple[float, ...]
    excess: float
    errors: dict[str, float]
    outside: float
    seconds: float
    tied: bool
    hull: ConvexHull
    centers: tuple[Floats, ...]

    @cached_property
    def condition(self) -> float:
        """Condition, see `tests.reference.oracle_derivatives`; 0 for hulls too large for the
        oracle."""
        if self.facets > ORACLE_FACETS:
            return 0.0
        return max(probability_condition(self.hull, center) for center in self.centers)

    def limit(self, error: float, least: float = ERROR_LIMIT) -> float:
        """Tolerance on an error due to rounding, at least a given one; the condition is computed
        only for larger errors."""
        if error <= least:
            return least
        return max(least, CONDITION_FACTOR * self.condition * float(np.finfo(np.float64).eps))


def measure(
    problem: Problem, *, oracle: bool = True, query: Callable[..., RestPoses] = rest_poses
) -> Measurement:
    """Compute the rests of a problem, and their errors. Raises as `rest_poses`.

    The oracle has the center of mass of a uniform solid in 60 digits. For a tied body it has the
    centers to which the product moved it, as the probabilities are defined as the mean over the
    bodies beside it.

    oracle: whether a small hull is compared with the oracle. query: `rest_poses`, or a replacement.
    """
    body = make_body(problem.points, problem.triangles)
    started = time.perf_counter()
    poses = query(body, problem.center, coplanar_tolerance=problem.coplanar_tolerance)
    seconds = time.perf_counter() - started
    sides = poses.basins
    hull = sides[0].equilibria.hull
    errors = {}
    if problem.shares is not None:
        errors["closed form"] = share_error(problem.shares, poses.probabilities)
    if problem.symmetries:
        errors["symmetry"] = max(_asymmetry(poses, matrix) for matrix in problem.symmetries)
    if oracle and len(hull.normals) <= ORACLE_FACETS:
        centers = [side.equilibria.center_of_mass for side in sides[:SIDES]]
        if problem.center is None and len(sides) == 1:
            centers = [_uniform_center(problem, body, poses)]
        errors["oracle"] = max(
            _difference_from_mean(poses, sides),
            *(_oracle_error(hull, *s) for s in zip(sides[:SIDES], centers, strict=True)),
        )
    return Measurement(
        facets=len(poses.hull.normals),
        rests=len(poses.probabilities),
        probabilities=tuple(poses.probabilities.tolist()),
        excess=float(poses.probabilities.sum()) - 1.0,
        errors=errors,
        outside=_outside(hull, body.points, poses.center_of_mass),
        seconds=seconds,
        tied=len(sides) > 1,
        hull=hull,
        centers=tuple(side.equilibria.center_of_mass for side in sides[:SIDES]),
    )


def verdict(measurement: Measurement, rests: int | None = None, facets: int | None = None) -> str:
    """`OK`, or the fault of a measurement. rests, facets: their numbers, if known."""
    if rests is not None and measurement.rests != rests:
        return f"{measurement.rests} rests instead of {rests}"
    if facets is not None and measurement.facets != facets:
        return f"{measurement.facets} facets instead of {facets}"
    if not abs(measurement.excess) <= ERROR_LIMIT:
        return f"sum of probabilities off by {measurement.excess:.1e}"
    if measurement.outside > OUTSIDE_LIMIT:
        return f"point outside of the hull by {measurement.outside:.1e}"
    for name, error in measurement.errors.items():
        limit = measurement.limit(error)
        if not error <= limit:
            return f"error {error:.1e} ({name}) above {limit:.1e}"
    return OK


def share_error(expected: Floats, actual: Floats) -> float:
    """Largest difference of sorted probabilities (k,) and (l,); missing ones are 0."""
    both = np.zeros((2, max(len(expected), len(actual))))
    for row, values in zip(both, (expected, actual), strict=True):
        row[: len(values)] = np.sort(values)[::-1]
    return float(np.abs(both[0] - both[1]).max())


def _oracle_error(hull: ConvexHull, side: Basins, center: Floats) -> float:
    """Largest error of a probability on one side, for its center of mass (3,)."""
    misses = np.array(hull_probabilities(hull, [center]))
    misses[side.paths.rests] -= side.areas / (4.0 * np.pi)
    return float(abs(misses).max())


def _difference_from_mean(poses: RestPoses, sides: tuple[Basins, ...]) -> float:
    """Largest difference of the returned probabilities from the mean over all sides."""
    difference = np.zeros(len(poses.hull.normals))
    difference[poses.facets] = poses.probabilities
    for side in sides:
        mean = side.areas / (4.0 * np.pi * len(sides))
        np.subtract.at(difference, merged_rests(poses.hull, side), mean)
    return float(np.abs(difference).max())


def _uniform_center(problem: Problem, body: Body, poses: RestPoses) -> Floats:
    """Center of mass (3,) of the uniform mesh or hull, computed in 60 digits and rounded; or the
    center of the poses if both differ only by rounding of coordinates, which is large far from the
    origin.

    The hull is the original one, even if `find_basins` remade it.
    """
    hull = convex_hull(
        body.points, problem.coplanar_tolerance, single_precision=body.single_precision
    )
    points, triangles = hull.vertices, hull.triangles
    if body.triangles is not None and poses.center_of_mass_source == "uniform solid":
        oriented = consistent_winding(body.triangles)
        assert oriented is not None
        points, triangles = body.points, oriented
    with mpmath.workdps(DIGITS):
        center = solid_centroid(exact(points), triangles).astype(np.float64)
    rounding = ULPS * float(np.finfo(np.float64).eps) * _reach(hull.vertices)
    by_product = poses.center_of_mass
    return by_product if np.abs(by_product - center).max() <= rounding else center


def _reach(points: Floats) -> float:
    """Size of the roundings in sums over points (n, 3): their largest coordinate, and far from the
    origin at least their squared extent over their thickness."""
    far = float(np.abs(points).max())
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if far < FAR * float(extents[0]):
        return far
    return max(far, float(extents[0] ** 2 / extents[-1]))


def _asymmetry(poses: RestPoses, matrix: Floats) -> float:
    image = cKDTree(poses.normals).query(poses.normals @ matrix.T)[1]
    return float(np.abs(poses.probabilities - poses.probabilities[image]).max())


def _outside(hull: ConvexHull, points: Floats, center: Floats) -> float:
    if len(points) * len(hull.normals) > HULL_CHECK_PAIRS:
        return float("nan")
    local, corners = points - center, hull.vertices - center
    normals, areas, heights = facet_planes(hull, corners)
    scale = float(np.ptp(corners, axis=0).max()) / 2.0
    beyond = (local @ normals.T - heights[1]).max(axis=0)
    # The plane of a slender facet is less accurate.
    rounding = 4.0 * float(np.finfo(np.float64).eps * np.abs(points).max())
    return float((beyond - rounding * (1.0 + scale * scale / areas)).max()) / scale


def facet_planes(hull: ConvexHull, corners: Floats) -> tuple[Floats, Floats, Floats]:
    """Unit normals (m, 3) and areas (m,) of facets with corners (n, 3), and the least and the
    largest heights (2, m) of the corners of each facet, from the corners alone."""
    start = hull.facet_start[:-1]
    anchor = corners[hull.tail[start]][hull.facet]
    swept = np.linalg.cross(corners[hull.tail] - anchor, corners[hull.head] - anchor)
    vectors = np.add.reduceat(swept, start)
    # The area of a sliver may be less than floats can tell.
    doubled = np.maximum(norms(vectors), 1e-200)
    normals = vectors / doubled[:, None]
    heights = (corners[hull.tail] * normals[hull.facet]).sum(axis=1)
    least, largest = np.minimum.reduceat(heights, start), np.maximum.reduceat(heights, start)
    return normals, doubled / 2.0, np.stack([least, largest])
