"""Hulls designed on small bodies: what they promise, by the forward model."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere, unit

from dicedesign import rest_poses
from dicedesign.concave.fill.paper_options import ConcavePaperOptions
from dicedesign.concave.hull.design import design_hull
from dicedesign.concave.hull.draft import HullDraft
from dicedesign.concave.hull.easing import eased_hull, nearer_draft
from dicedesign.concave.hull.outcome_directions import outcome_choices
from dicedesign.concave.hull.paper_hull import descend_hull, searched_hull
from dicedesign.concave.hull.problem import DesignedHull, HullMetric, HullProblem
from dicedesign.concave.hull.slopes import SlopeOptions
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.kernels import ops as kernels
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.runtime.arrays import Floats

SLOPES = SlopeOptions(fall=3e-3, rise=3e-3, circle=float(np.radians(3.0)))
TOLERANCE = 0.004
SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])


def problem_of(surface: Surface, target: Floats) -> HullProblem:
    """Of a sheared surface: symmetric bodies have ties."""
    return HullProblem(unit(surface.moved(surface.points @ SHEAR)), target, TOLERANCE)


@cache
def bumpy_problem() -> HullProblem:
    return problem_of(bumpy_sphere(), np.array([0.5, 0.5]))


def designed(problem: HullProblem) -> tuple[DesignedHull | None, list[tuple[float, float]]]:
    steps: list[tuple[float, float]] = []
    directions = outcome_choices(problem.hull, problem.target)[0]
    found = design_hull(problem, directions, SLOPES, lambda *step: steps.append(step))
    return found, steps


@cache
def bumpy_design() -> DesignedHull:
    found, _ = designed(bumpy_problem())
    assert found is not None
    return found


def original_draft(problem: HullProblem) -> HullDraft:
    directions = outcome_choices(problem.hull, problem.target)[0]
    draft = HullDraft.of(problem.hull.vertices, directions)
    assert draft is not None
    return draft


@pytest.mark.parametrize(
    ("surface", "target"),
    [
        (bumpy_sphere(), [0.5, 0.5]),
        (bumpy_sphere(1), [0.6, 0.4]),
        (bent_capsule(18, 10), [0.5, 0.5]),
    ],
)
def test_the_odds_are_the_wanted_ones(surface: Surface, target: list[float]) -> None:
    problem = problem_of(surface, np.array(target))
    design, steps = designed(problem)
    assert design is not None
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    odds = outcome_odds(poses, design.directions)
    assert odds.error(problem.target) == pytest.approx(design.error, abs=1e-9)
    assert design.error <= TOLERANCE
    assert steps[-1][1] == design.error
    assert steps[0][1] > 10.0 * TOLERANCE


def test_corners_are_those_of_the_surface_moved() -> None:
    problem, design = bumpy_problem(), bumpy_design()
    own = problem.hull
    place = np.full(len(problem.surface.points), -1)
    place[own.source] = np.arange(len(own.source))
    moved = design.moved[place[design.corners]] + design.center_of_mass
    expected = problem.surface.points[design.corners] + moved
    np.testing.assert_allclose(design.hull.vertices, expected, atol=1e-14)
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert len(design.corners) > 0.7 * len(own.vertices)
    lengths = np.linalg.norm(moved, axis=1)
    assert lengths.mean() < 0.2


def test_the_center_of_mass_is_about_where_the_surface_takes_it() -> None:
    """To first order: the rest is for the fill to correct."""
    problem, design = bumpy_problem(), bumpy_design()
    forces = np.tensordot(design.moved, problem.relative[0], 2)
    every = problem.elasticity.responses(problem.hull.source)
    whole = problem.surface.moved(problem.surface.points + design.center_of_mass)
    np.testing.assert_allclose(whole.centroid, design.center_of_mass, atol=1e-14)
    raised = every @ forces - problem.elasticity.responses(
        np.arange(len(problem.surface.points))
    ) @ _center_forces(problem, forces.sum(axis=0))
    corners = raised[problem.hull.source] - design.center_of_mass
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
    again, _ = designed(problem_of(bumpy_sphere(), np.array([0.5, 0.5])))
    assert again is not None
    first = bumpy_design()
    assert again.hull.vertices.tobytes() == first.hull.vertices.tobytes()
    assert again.directions.tobytes() == first.directions.tobytes()


def test_where_no_hull_comes_about_there_is_none() -> None:
    """Outcomes that are nowhere near each other's odds, on a body of few corners."""
    problem = problem_of(bumpy_sphere(1), np.array([0.97, 0.01, 0.01, 0.01]))
    assert designed(problem)[0] is None


@pytest.mark.parametrize("compiled", [True, False])
def test_the_jacobian_by_finite_differences(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        monkeypatch.setattr(kernels, "compiled", None)
    problem = bumpy_problem()
    draft = original_draft(problem)
    assert len(draft.of_rest) > len(problem.target)
    way = np.random.default_rng(4).normal(size=draft.corners.shape)
    step = 1e-8
    sides = [HullDraft.of(draft.corners + s * way, draft.directions) for s in (step, -step)]
    assert sides[0] is not None
    assert sides[1] is not None
    expected = (sides[0].odds - sides[1].odds) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(draft.jacobian, way, 2), expected, rtol=1e-5)
    np.testing.assert_allclose(draft.jacobian.sum(axis=0), 0.0, atol=1e-12)


def test_a_draft_without_the_center_of_mass_is_none() -> None:
    problem = bumpy_problem()
    draft = original_draft(problem)
    assert HullDraft.of(draft.corners + np.array([2.0, 0.0, 0.0]), draft.directions) is None
    flat = draft.corners * np.array([1.0, 1.0, 0.0])
    assert HullDraft.of(flat, draft.directions) is None


def test_the_metric_is_smoothness_and_work() -> None:
    problem = bumpy_problem()
    hull, count = problem.hull, len(problem.hull.vertices)
    u = np.random.default_rng(5).normal(size=(count, 3))
    rough = np.zeros_like(u)
    for tail, head in zip(hull.tail.tolist(), hull.head.tolist(), strict=True):
        rough[tail] += u[tail] - u[head]
    costs = []
    for metric in (HullMetric(0.5, 2.0, 0.0), HullMetric(0.5, 2.0, 3.0)):
        flat = problem.compliance(metric).reshape(3 * count, 3 * count)
        costs.append(float(u.ravel() @ np.linalg.solve(flat, u.ravel())))
    assert costs[0] == pytest.approx(((0.5 * u + 2.0 * rough) ** 2).sum() / count, rel=1e-7)
    work = np.tensordot(np.tensordot(u, problem.relative[0], 2), u, 2)
    assert costs[1] - costs[0] == pytest.approx(3.0 * float(work), rel=1e-4)


def test_easing_keeps_the_odds_and_takes_corners_back() -> None:
    problem, design = bumpy_problem(), bumpy_design()
    places = problem.surface.points[:10]
    eased = eased_hull(problem, design, places, 0.3)
    assert eased is not None
    poses = rest_poses(eased.hull.vertices, center_of_mass=eased.center_of_mass)
    assert outcome_odds(poses, eased.directions).error(problem.target) <= TOLERANCE
    far = np.array([[9.0, 9.0, 9.0]])
    assert eased_hull(problem, design, far, 0.3) is None


def test_what_is_nearer_keeps_odds_and_outcomes() -> None:
    problem, design = bumpy_problem(), bumpy_design()
    start = HullDraft.of(problem.hull.vertices + design.moved, design.directions)
    assert start is not None
    nearer = nearer_draft(problem, start, SLOPES)
    poses = rest_poses(nearer.rests.hull.vertices, center_of_mass=np.zeros(3))
    odds = outcome_odds(poses, nearer.normals)
    assert odds.error(problem.target) <= TOLERANCE
    assert (odds.main >= 0).all()
    # It moves: there is work to be saved, or slopes to be had.
    assert np.abs(nearer.corners - start.corners).max() > 1e-6
    turned = np.arccos(np.clip((nearer.normals * start.normals).sum(1), -1.0, 1.0))
    assert np.degrees(turned.max()) < 30.0


def fixed_center(design: DesignedHull, problem: HullProblem) -> float:
    """Error of a design by the forward model."""
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    return outcome_odds(poses, design.directions).error(problem.target)


@pytest.mark.parametrize("finish", ["exact", "none"])
def test_descent_as_in_the_paper(finish: Literal["exact", "none"]) -> None:
    problem = problem_of(bumpy_sphere(1), np.array([0.5, 0.5]))
    steps: list[tuple[float, float]] = []
    directions = outcome_choices(problem.hull, problem.target)[0]
    options = ConcavePaperOptions(finish=finish, steps=200)
    design = descend_hull(problem, directions, options, lambda *step: steps.append(step))
    assert fixed_center(design, problem) == pytest.approx(design.error, abs=1e-9)
    energies = [energy for energy, _ in steps]
    assert min(energies) < energies[0]
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert np.isin(design.corners, problem.hull.source).all()


def test_without_drift_a_hull_stays_about_its_center_of_mass() -> None:
    problem = problem_of(bumpy_sphere(2), np.full(3, 1.0 / 3.0))
    directions = outcome_choices(problem.hull, problem.target)[0]
    shifts = []
    for drift in (False, True):
        options = ConcavePaperOptions(drift=drift, steps=200)
        design = descend_hull(problem, directions, options, lambda *step: None)
        shifts.append(np.linalg.norm(design.center_of_mass))
    assert shifts[0] < 0.5 * shifts[1]


def test_the_best_of_several_hulls_by_the_paper_is_taken() -> None:
    problem = problem_of(bumpy_sphere(2), np.array([0.5, 0.5]))
    choices = outcome_choices(problem.hull, problem.target)
    options, random = ConcavePaperOptions(steps=100), np.random.default_rng(1)
    design = searched_hull(problem, choices, options, random, lambda *step: None, plain=True)
    first = descend_hull(problem, choices[0], options, lambda *step: None)
    assert fixed_center(design, problem) <= max(problem.tolerance, first.error)
