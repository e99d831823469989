"""Hulls on the way and at its end, against the forward model of the same hull."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere
from common.hull_problems import SLOPES, choices_of, designed, original_draft, problem_of

from dicedesign import rest_poses
from dicedesign.concave.hull_design import (
    HullDraft,
    design_hull,
    exact_draft,
    make_designed_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import HullProblem
from dicedesign.geometry.triangles import Surface
from dicedesign.kernels import ops as kernels
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities


@cache
def problem() -> HullProblem:
    return problem_of(bumpy_sphere(), [0.3, 0.5, 0.2])


@cache
def good() -> HullDraft:
    return designed(problem())


def drafts() -> list[HullDraft]:
    """One with many rests, one with those of its outcomes alone."""
    first = original_draft(problem())
    assert len(first.of_rest) > len(problem().target)
    assert not first.alone
    assert good().alone
    return [first, good()]


@pytest.mark.parametrize("place", [0, 1])
def test_angles_and_probabilities_are_those_of_the_body(place: int) -> None:
    draft = drafts()[place]
    poses = rest_poses(draft.rests.hull.vertices, center_of_mass=np.zeros(3))
    outcomes = outcome_probabilities(poses, draft.normals)
    assert draft.error(problem().target) == pytest.approx(outcomes.error(problem().target))
    assert draft.apart == pytest.approx(outcomes.least_angle, abs=1e-9)
    same = np.argmax(poses.normals @ draft.rest_normals.T, axis=1)
    assert sorted(same.tolist()) == list(range(len(draft.rest_normals)))
    # Each rest belongs to an outcome here, however far it is from it.
    gathered = replace(outcomes, outcome_of_rest=draft.of_rest[same])
    margins = outcome_margins(poses, gathered)
    assert draft.margin == pytest.approx(margins.min(), abs=1e-7)
    np.testing.assert_allclose(gathered.sums(poses.probabilities), draft.probabilities, atol=1e-9)
    assert draft.probabilities.sum() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("lacking", ["", "probabilities", "apart", "probabilities apart margin"])
def test_the_shortfall_is_zero_exactly_where_everything_holds(lacking: str) -> None:
    draft = good()
    error, apart, margin = draft.error(problem().target), draft.apart, draft.margin
    tolerance, least, leave = max(1.01 * error, 1e-6), 0.99 * apart, 0.99 * margin
    expected = 0.0
    target = problem().target
    if "probabilities" in lacking:
        target = target + np.array([0.02, -0.01, -0.01])
        error = draft.error(target)
        tolerance = 0.8 * error
        expected += 0.25
    if "apart" in lacking:
        least = 1.25 * apart
        expected += 0.2
    if "margin" in lacking:
        leave = 2.0 * margin
        expected += 0.5
    asked = HullProblem(problem().surface, target, tolerance, least, leave)
    found = draft.shortfall(asked)
    assert (found == 0.0) == (not lacking)
    assert found == pytest.approx(expected, abs=1e-9)
    assert draft.lacks_at_most(asked, found)
    assert draft.lacks_at_most(asked, found + 0.1)
    assert not draft.lacks_at_most(asked, 0.9 * found - 1e-9)


@pytest.mark.parametrize("compiled", [True, False])
def test_the_jacobian_by_finite_differences(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        monkeypatch.setattr(kernels, "compiled", None)
    draft = original_draft(problem())
    way = np.random.default_rng(4).normal(size=draft.corners.shape)
    step = 1e-8
    sides = [HullDraft.of(draft.corners + s * way, draft.directions) for s in (step, -step)]
    assert sides[0] is not None
    assert sides[1] is not None
    expected = (sides[0].probabilities - sides[1].probabilities) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(draft.jacobian, way, 2), expected, rtol=1e-5)
    np.testing.assert_allclose(draft.jacobian.sum(axis=0), 0.0, atol=1e-12)


def test_a_draft_without_the_center_of_mass_is_none() -> None:
    draft = original_draft(problem())
    assert HullDraft.of(draft.corners + np.array([2.0, 0.0, 0.0]), draft.directions) is None
    flat = draft.corners * np.array([1.0, 1.0, 0.0])
    assert HullDraft.of(flat, draft.directions) is None


def test_an_exact_one_has_the_probabilities_to_rounding_and_needs_its_outcomes_alone() -> None:
    first, draft = drafts()
    assert exact_draft(problem(), first) is None
    near = HullDraft.of(draft.corners + 1e-4 * np.sin(9.0 * draft.corners), draft.normals)
    assert near is not None
    assert near.error(problem().target) > 1e-7
    exact = exact_draft(problem(), near)
    assert exact is not None
    poses = rest_poses(exact.rests.hull.vertices, center_of_mass=np.zeros(3))
    assert outcome_probabilities(poses, exact.normals).error(problem().target) < 1e-10


@pytest.mark.parametrize(
    ("surface", "target", "apart_deg", "margin_deg"),
    [
        (bumpy_sphere(), [0.5, 0.5], 45.0, 10.0),
        (bent_capsule(18, 10), [0.5, 0.5], 0.0, 0.0),
        (bumpy_sphere(), [0.2, 0.5, 0.3], 70.0, 0.0),
    ],
)
def test_probabilities_and_angles_are_as_wanted(
    surface: Surface, target: list[float], apart_deg: float, margin_deg: float
) -> None:
    problem = problem_of(surface, target, apart_deg, margin_deg)
    design = make_designed_hull(problem, settle_draft(problem, designed(problem)))
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    outcomes = outcome_probabilities(poses, design.directions)
    assert outcomes.error(problem.target) <= problem.tolerance
    assert outcomes.error(problem.target) == pytest.approx(design.error, abs=1e-9)
    assert np.degrees(outcomes.least_angle) >= apart_deg - 1e-6
    assert np.degrees(outcome_margins(poses, outcomes).min()) >= margin_deg - 1e-6


def test_where_none_is_as_wanted_there_is_the_best_on_the_way() -> None:
    """Far apart as no three can be."""
    problem = problem_of(bumpy_sphere(1), [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], 170.0)
    directions = choices_of(problem)[0]
    first = HullDraft.of(problem.hull.vertices, directions)
    draft = design_hull(problem, directions, SLOPES, lambda *step: None)
    assert first is not None
    assert draft is not None
    assert 0.0 < draft.shortfall(problem) < first.shortfall(problem)


def test_corners_are_those_of_the_surface_moved() -> None:
    problem = problem_of(bumpy_sphere(1), [0.6, 0.4])
    design = make_designed_hull(problem, designed(problem))
    place = np.full(len(problem.surface.points), -1)
    place[problem.source] = np.arange(len(problem.source))
    moved = design.moved[place[design.corners]] + design.center_of_mass
    expected = problem.surface.points[design.corners] + moved
    np.testing.assert_allclose(design.hull.vertices, expected, atol=1e-14)
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert len(design.corners) > 0.7 * len(problem.source)
    assert np.linalg.norm(moved, axis=1).mean() < 0.3
