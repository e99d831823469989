"""Hulls designed on small bodies: what they promise, by the forward model."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere
from common.hull_problems import SLOPES, choices_of, designed, original_draft, problem_of

from dicedesign import rest_poses
from dicedesign.concave.easing import settled_draft
from dicedesign.concave.hull_design import HullDraft, design_hull, designed_hull
from dicedesign.concave.hull_problem import DesignedHull, HullMetric, HullProblem
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.rest.outcomes import outcome_margins, outcome_odds
from dicedesign.runtime.arrays import Floats

THIRDS = [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0]


@cache
def bumpy_problem() -> HullProblem:
    return problem_of(bumpy_sphere(), [0.5, 0.5])


@cache
def bumpy_design() -> DesignedHull:
    return designed_hull(bumpy_problem(), designed(bumpy_problem()))


@pytest.mark.parametrize(
    ("surface", "target", "apart_deg", "margin_deg"),
    [
        (bumpy_sphere(), [0.5, 0.5], 45.0, 10.0),
        (bumpy_sphere(1), [0.6, 0.4], 45.0, 10.0),
        (bent_capsule(18, 10), [0.5, 0.5], 0.0, 0.0),
        (bumpy_sphere(), THIRDS, 60.0, 15.0),
        (bumpy_sphere(), [0.2, 0.5, 0.3], 70.0, 0.0),
    ],
)
def test_odds_and_angles_are_as_wanted(
    surface: Surface, target: list[float], apart_deg: float, margin_deg: float
) -> None:
    problem = problem_of(surface, target, apart_deg, margin_deg)
    design = designed_hull(problem, settled_draft(problem, designed(problem)))
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    outcomes = outcome_odds(poses, design.directions)
    assert outcomes.error(problem.target) <= problem.tolerance
    assert outcomes.error(problem.target) == pytest.approx(design.error, abs=1e-9)
    assert np.degrees(outcomes.least_angle) >= apart_deg - 1e-6
    assert np.degrees(outcome_margins(poses, outcomes).min()) >= margin_deg - 1e-6


def test_steps_are_told_from_the_original_on() -> None:
    problem = bumpy_problem()
    first = original_draft(problem)
    steps: list[tuple[float, float]] = []
    design_hull(problem, choices_of(problem)[0], SLOPES, lambda *step: steps.append(step))
    assert steps[0] == (((problem.target - first.odds) ** 2).sum(), first.error(problem.target))
    assert min(error for _, error in steps) < steps[0][1]


@pytest.mark.parametrize(
    ("target", "apart_deg"), [([0.97, 0.01, 0.01, 0.01], 45.0), (THIRDS, 170.0)]
)
def test_where_none_is_as_wanted_there_is_the_best_on_the_way(
    target: list[float], apart_deg: float
) -> None:
    """Outcomes that are nowhere near each other's odds, or far apart as no three can be."""
    problem = problem_of(bumpy_sphere(1), target, apart_deg)
    directions = choices_of(problem)[0]
    first = HullDraft.of(problem.hull.vertices, directions)
    draft = design_hull(problem, directions, SLOPES, lambda *step: None)
    assert first is not None
    assert draft is not None
    assert 0.0 < draft.shortfall(problem) < first.shortfall(problem)


def test_where_the_center_of_mass_is_outside_there_is_none() -> None:
    problem = bumpy_problem()
    outside = HullProblem(
        problem.surface.moved(problem.surface.points + 2.0), problem.target, problem.tolerance
    )
    told: list[float] = []
    directions = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    assert design_hull(outside, directions, SLOPES, lambda *step: told.append(step[0])) is None
    assert told == []


def test_corners_are_those_of_the_surface_moved() -> None:
    problem, design = bumpy_problem(), bumpy_design()
    place = np.full(len(problem.surface.points), -1)
    place[problem.source] = np.arange(len(problem.source))
    moved = design.moved[place[design.corners]] + design.center_of_mass
    expected = problem.surface.points[design.corners] + moved
    np.testing.assert_allclose(design.hull.vertices, expected, atol=1e-14)
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert len(design.corners) > 0.7 * len(problem.source)
    assert np.linalg.norm(moved, axis=1).mean() < 0.3


def test_the_center_of_mass_is_about_where_the_surface_takes_it() -> None:
    """To first order: the rest is for the fill to correct."""
    problem, design = bumpy_problem(), bumpy_design()
    forces = np.tensordot(design.moved, problem.relative[0], 2)
    every = problem.elasticity.responses(problem.source)
    whole = problem.surface.moved(problem.surface.points + design.center_of_mass)
    np.testing.assert_allclose(whole.centroid, design.center_of_mass, atol=1e-14)
    raised = every @ forces - problem.elasticity.responses(
        np.arange(len(problem.surface.points))
    ) @ _center_forces(problem, forces.sum(axis=0))
    corners = raised[problem.source] - design.center_of_mass
    np.testing.assert_allclose(corners, design.moved, atol=1e-5)


def _center_forces(problem: HullProblem, force: Floats) -> Floats:
    """(n, 3) forces on all points that act on the center of mass like one force (3,)."""
    points, step = problem.surface.points, 1e-5
    forces = np.zeros_like(points)
    for point in range(len(points)):
        for axis in range(3):
            sides = []
            for sign in (step, -step):
                shifted = points.copy()
                shifted[point, axis] += sign
                sides.append(problem.surface.moved(shifted).centroid)
            forces[point, axis] = (sides[0] - sides[1]) @ force / (2.0 * step)
    return forces


def test_the_same_is_designed_again() -> None:
    first, again = (designed(problem_of(bumpy_sphere(), [0.5, 0.5])) for _ in range(2))
    assert again.corners.tobytes() == first.corners.tobytes()
    assert again.directions.tobytes() == first.directions.tobytes()


def test_the_metric_is_smoothness_and_work_and_displacement() -> None:
    problem = bumpy_problem()
    hull, count = problem.hull, len(problem.hull.vertices)
    u = np.random.default_rng(5).normal(size=(count, 3))
    rough = np.zeros_like(u)
    for tail, head in zip(hull.tail.tolist(), hull.head.tolist(), strict=True):
        rough[tail] += u[tail] - u[head]
    costs = []
    for elastic, displaced in ((0.0, 0.0), (3.0, 0.0), (0.0, 3.0)):
        metric = HullMetric(0.5, 2.0, elastic, displaced)
        flat = problem.compliance(metric).reshape(3 * count, 3 * count)
        costs.append(float(u.ravel() @ np.linalg.solve(flat, u.ravel())))
    assert costs[0] == pytest.approx(((0.5 * u + 2.0 * rough) ** 2).sum() / count, rel=1e-7)
    work = np.tensordot(np.tensordot(u, problem.relative[0], 2), u, 2)
    assert costs[1] - costs[0] == pytest.approx(3.0 * float(work), rel=1e-4)
    square = (problem.displacement(u) * problem.surface.diagonal) ** 2
    assert costs[2] - costs[0] == pytest.approx(3.0 * square, rel=1e-4)
