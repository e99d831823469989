"""Changes of a body that keep its rests, or only renumber them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from tests.reference.measurement import OK, measure, share_error, verdict
from tests.reference.problem import Problem

CRAMPED = 1e-12
"""Depth of a center of mass over the body's extent below which probabilities have few correct
digits."""


@dataclass(frozen=True)
class Law:
    """A changed body, and how its rests relate to the original ones.

    Attributes
    ----------
    name: the change.
    problem: the changed body.
    factors: (3,) by which coordinates were multiplied.
    exact: whether the probabilities keep every bit.
    tied: whether the probabilities of a tied body are kept too.
    """

    name: str
    problem: Problem
    factors: Floats
    exact: bool
    tied: bool


def laws(problem: Problem, center: Floats) -> Iterator[Law]:
    """Changed bodies: permuted, scaled by a power of two, with points inside, mirrored.

    center: (3,) center of mass, given explicitly to all of them, so that rounding of the uniform
    solid's centroid does not enter the comparison.
    """
    rng = np.random.default_rng(len(problem.points))
    points, same = problem.points, np.ones(3)
    given = replace(problem, center=center)
    order = rng.permutation(len(points))
    yield Law("permuted", replace(given, points=points[order]), same, exact=False, tied=True)
    power = float(2.0 ** rng.integers(-20, 21))
    scaled = replace(given, points=power * points, center=power * center)
    yield Law(f"scaled by {power:g}", scaled, power * same, exact=True, tied=True)
    middle = np.unique(points, axis=0).mean(axis=0)
    corners = points[rng.integers(len(points), size=5)]
    inner = middle + rng.uniform(0.0, 0.9, size=(5, 1)) * (corners - middle)
    filled = np.concatenate([points, inner])
    yield Law("with points inside", replace(given, points=filled), same, exact=False, tied=True)
    signs = rng.choice([-1.0, 1.0], size=3)
    signs *= -np.prod(signs)
    mirrored = replace(given, points=signs * points, center=signs * center)
    # A tied body's center of mass is moved along one direction, whichever way the body is turned.
    yield Law("mirrored", mirrored, signs, exact=False, tied=False)


def ask(problem: Problem) -> RestPoses:
    """The rests of a problem."""
    tolerance = problem.coplanar_tolerance
    return rest_poses(problem.points, problem.center, coplanar_tolerance=tolerance)


def difference_from_exact(problem: Problem, poses: RestPoses) -> float:
    """Largest difference of a probability between a body and its hull at tolerance 0, matching
    rests by the nearest normals."""
    exact = replace(problem, center=poses.center_of_mass, coplanar_tolerance=0.0)
    assert verdict(measure(exact)) == OK
    probabilities = ask(exact)
    sums = np.zeros(len(poses.normals))
    np.add.at(
        sums,
        np.argmax(probabilities.normals @ poses.normals.T, axis=1),
        probabilities.probabilities,
    )
    return float(np.abs(sums - poses.probabilities).max())


def is_tied(poses: RestPoses) -> bool:
    """Whether the probabilities are the mean over several bodies."""
    return len(poses.basins) > 1


def difference(law: Law, poses: RestPoses, changed: RestPoses) -> float:
    """Largest difference of a probability between a body and the changed one, facet by facet; in
    order of size if the facets have other corners at nearly equal positions."""
    before, after = _by_corners(poses, law.factors), _by_corners(changed, np.ones(3))
    if before.keys() != after.keys():
        return share_error(poses.probabilities, changed.probabilities)
    return max(abs(before[rest] - after[rest]) for rest in before)


def _by_corners(poses: RestPoses, factors: Floats) -> dict[frozenset[tuple[float, ...]], float]:
    """Probabilities of rests by the corners of their facets, multiplied by factors (3,)."""
    polygons = [poses.hull.polygon(facet) * factors + 0.0 for facet in poses.facets]
    keys = [frozenset(map(tuple, polygon.tolist())) for polygon in polygons]
    return dict(zip(keys, poses.probabilities.tolist(), strict=True))


def other_points_stand(law: Law, poses: RestPoses, changed: RestPoses) -> bool:
    """Whether the two hulls have different corners."""
    before = np.sort((law.factors * poses.hull.vertices).view("f8,f8,f8"), axis=0)
    after = np.sort((changed.hull.vertices + 0.0).view("f8,f8,f8"), axis=0)
    return not np.array_equal(before, after)


def is_cramped(poses: RestPoses) -> bool:
    """Whether the center of mass is so near the surface that the moves of a tied body are limited
    by its depth, which rounding leaves with few digits."""
    extent = float(np.ptp(poses.hull.vertices, axis=0).max())
    return float(poses.hull.heights(poses.center_of_mass).min()) < CRAMPED * extent
