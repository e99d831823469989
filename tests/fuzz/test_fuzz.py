"""Bodies of every kind: never a crash, a wrong refusal or a wrong number.

Each body's probabilities are held against the 60-digit oracle, and against its own probabilities
after changes that change nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from laws import (
    Law,
    ask,
    difference,
    difference_from_exact,
    is_cramped,
    is_tied,
    laws,
    other_points_stand,
)
from refusals import may_be_refused, thickness
from strategies import KINDS, clouds, flat

from dicedesign.errors import DegenerateBodyError, OutsideHullError
from dicedesign.rest.poses import UNEVEN, RestPoses, rest_poses
from tests.reference.measurement import (
    OK,
    Measurement,
    facet_planes,
    measure,
    verdict,
)
from tests.reference.oracle import OracleError
from tests.reference.problem import Problem

FUZZ = settings.get_profile("fuzz")

UNEVEN_LIMIT = 1e-7
"""Largest error of a probability where merged facets are as narrow as they are uneven, or none are
merged for that: the coplanar tolerance times the condition of such bodies."""


STANDING_LIMIT = 1e-9
"""Largest change of a probability where other points of a cluster within the coplanar tolerance
stand for it: the tolerance times the condition of most bodies."""


def check(problem: Problem) -> None:
    """A body is refused for a reason, or its probabilities are right and stay so."""
    try:
        measurement = measure_body(problem)
    except (DegenerateBodyError, OutsideHullError):
        if not may_be_refused(problem):
            raise
        return
    assert min(measurement.probabilities) > 0.0
    poses = ask(problem)
    error = measurement.errors.get("oracle", np.inf)
    if error > measurement.limit(error) and problem.coplanar_tolerance != 0.0:
        # Facets as narrow as they are uneven make no polyhedron that the oracle could judge.
        error = difference_from_exact(problem, poses)
        assert error < UNEVEN_LIMIT + spread(measurement, poses), (
            f"{measurement.errors} at {measurement.condition}, exact hull {error:.1e}"
        )
        measurement = replace(measurement, errors={**measurement.errors, "oracle": 0.0})
    assert verdict(measurement, problem.rests) == OK
    for law in laws(problem, poses.center_of_mass):
        if law.tied or not measurement.tied:
            keeps(law, poses, measurement)


def spread(measurement: Measurement, poses: RestPoses) -> float:
    """How much probabilities change where corners move by the unevenness of the facets, which far
    from the origin comes from the rounding of coordinates."""
    extent = float(np.ptp(poses.hull.vertices, axis=0).max())
    middle = poses.hull.vertices - poses.center_of_mass
    least, largest = facet_planes(poses.hull, middle)[2]
    uneven = float((largest - least).max()) / extent
    rounding = 64.0 * float(np.finfo(np.float64).eps)
    return measurement.condition * uneven if uneven > rounding else 0.0


def measure_body(problem: Problem) -> Measurement:
    """A body's measurement, without the oracle where its facets are too uneven for that."""
    try:
        return measure(problem)
    except OracleError:
        if problem.coplanar_tolerance == 0.0:
            raise
        return measure(problem, oracle=False)


def keeps(law: Law, poses: RestPoses, measurement: Measurement) -> None:
    """Assert that a changed body has the probabilities of the first, tied or not, to within the
    errors of both."""
    try:
        changed = ask(law.problem)
    except OutsideHullError:
        if not may_be_refused(law.problem):
            raise
        return
    change, tied = difference(law, poses, changed), measurement.tied
    limit = measurement.limit(change / 2.0)
    if change > 2.0 * limit:
        limit += spread(measurement, poses)
    if (is_unmerged(poses) or is_unmerged(changed)) and not law.exact:
        limit = UNEVEN_LIMIT
    elif law.exact:
        limit = 0.0
    elif tied and is_cramped(poses):
        return
    elif other_points_stand(law, poses, changed):
        limit = max(2.0 * limit, STANDING_LIMIT)
    else:
        # At the distance within which ties are looked for, and at the tolerance within which facets
        # are flat, rounding and the order of points decide.
        limit *= 2.0
        facets = len(changed.hull.normals), len(poses.hull.normals)
        if change > limit and (is_tied(changed) != tied or facets[0] != facets[1]):
            return
    assert change <= limit, f"{law.name}: probabilities changed by {change:.1e}"


def is_unmerged(poses: RestPoses) -> bool:
    """Whether a body rests by the hull of its points, as merged facets make no sense."""
    return UNEVEN in poses.notes or poses.hull.finer is not None


@pytest.mark.parametrize("kind", KINDS)
def test_bodies(kind: str) -> None:
    FUZZ(given(KINDS[kind])(check))()


@settings(FUZZ, max_examples=50)
@given(flat())
def test_points_on_a_plane_are_refused(problem: Problem) -> None:
    assert thickness(problem.points) < 1e-15
    with pytest.raises(DegenerateBodyError):
        rest_poses(problem.points, coplanar_tolerance=problem.coplanar_tolerance)


@settings(FUZZ, max_examples=50)
@given(clouds().filter(lambda problem: thickness(problem.points) > 1e-3))
def test_a_center_of_mass_outside_is_refused(problem: Problem) -> None:
    inside = problem.points.mean(axis=0)
    for corner in problem.points[:: max(len(problem.points) // 4, 1)]:
        far = (
            inside
            + (1.0 + 1e-9)
            * (problem.points - inside)[np.argmax((problem.points - inside) @ (corner - inside))]
        )
        with pytest.raises(OutsideHullError):
            rest_poses(problem.points, far, coplanar_tolerance=problem.coplanar_tolerance)
