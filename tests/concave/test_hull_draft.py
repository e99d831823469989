"""Hulls during their design, judged by the forward model of the same hull."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere
from common.hull_problems import choices_of, design_draft, original_draft, problem_of
from scipy.spatial import ConvexHull as OtherHull

from dicedesign import rest_poses
from dicedesign.concave.hull_design import design_hull
from dicedesign.concave.hull_draft import (
    HullDraft,
    exact_draft,
    make_designed_hull,
    relax_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import DesignedHull, HeldCorners, HullProblem
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.paper_hull import descend_hull, search_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.kernels import ops as kernels
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_margins, outcome_probabilities
from dicedesign.rest.poses import RestPoses


@cache
def problem() -> HullProblem:
    return problem_of(bumpy_sphere(), [0.3, 0.5, 0.2], 60.0, 15.0)


@cache
def good() -> HullDraft:
    return design_draft(problem())


def drafts() -> list[HullDraft]:
    """A draft with many rests, and one with only the rests of its outcomes."""
    first = original_draft(problem())
    assert len(first.of_rest) > len(problem().target)
    assert not first.alone
    assert good().alone
    return [first, good()]


def judge(design: DesignedHull) -> tuple[RestPoses, OutcomeProbabilities]:
    """Rests and outcomes of a designed hull by the forward model."""
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    return poses, outcome_probabilities(poses, design.directions)


def meets_limits(design: DesignedHull, problem: HullProblem) -> bool:
    poses, outcomes = judge(design)
    return bool(
        outcomes.error(problem.target) <= problem.tolerance
        and outcomes.least_angle >= problem.apart - 1e-9
        and outcome_margins(poses, outcomes).min() >= problem.margin - 1e-9
    )


@pytest.mark.parametrize("place", [0, 1])
def test_angles_and_probabilities_of_a_draft_are_those_of_the_body(place: int) -> None:
    draft = drafts()[place]
    poses = rest_poses(draft.rests.hull.vertices, center_of_mass=np.zeros(3))
    outcomes = outcome_probabilities(poses, draft.normals)
    assert draft.error(problem().target) == pytest.approx(outcomes.error(problem().target))
    assert draft.apart == pytest.approx(outcomes.least_angle, abs=1e-9)
    same = np.argmax(poses.normals @ draft.rest_normals.T, axis=1)
    assert sorted(same.tolist()) == list(range(len(draft.rest_normals)))
    # A draft assigns each rest to an outcome, however far they are apart.
    assigned = replace(outcomes, outcome_of_rest=draft.of_rest[same])
    margins = outcome_margins(poses, assigned)
    assert draft.margin == pytest.approx(margins.min(), abs=1e-7)
    np.testing.assert_allclose(assigned.sums(poses.probabilities), draft.probabilities, atol=1e-9)
    assert draft.probabilities.sum() == pytest.approx(1.0, abs=1e-9)


def test_the_clearance_of_a_draft_is_the_least_distance_of_a_foot_from_the_rim_of_its_facet() -> (
    None
):
    crowded, draft = drafts()
    assert crowded.clearance == 0.0
    hull = OtherHull(draft.corners)
    normals, heights = hull.equations[:, :3], -hull.equations[:, 3]
    cosines, distances = normals @ draft.normals.T, []
    for place, (normal, height) in enumerate(zip(normals, heights, strict=True)):
        facet = hull.simplices[place]
        corners = draft.corners[facet]
        # From a corner to the next, seen from outside.
        if np.linalg.det(np.stack([corners[1] - corners[0], corners[2] - corners[0], normal])) < 0:
            corners = corners[::-1]
        inward = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        depth = ((height * normal - corners) * inward).sum(axis=1).min()
        is_main = place in cosines.argmax(axis=0)
        if is_main or cosines[place].max() < np.cos(np.radians(5.0)):
            distances.append(depth if is_main else -depth)
    radius = np.linalg.norm(draft.corners, axis=1).max()
    assert draft.clearance == pytest.approx(min(distances) / radius, abs=1e-9)


@pytest.mark.parametrize(
    "violated", ["", "probabilities", "apart", "clearance", "probabilities apart margin"]
)
def test_the_shortfall_sums_relative_violations(violated: str) -> None:
    draft = good()
    error, apart, margin = draft.error(problem().target), draft.apart, draft.margin
    tolerance, least, leave = max(1.01 * error, 1e-6), 0.99 * apart, 0.99 * margin
    expected = 0.0
    target = problem().target
    if "probabilities" in violated:
        target = target + np.array([0.02, -0.01, -0.01])
        tolerance = 0.8 * draft.error(target)
        expected += 0.25
    if "apart" in violated:
        least = 1.25 * apart
        expected += 0.2
    if "margin" in violated:
        leave = 2.0 * margin
        expected += 0.5
    clear = 0.99 * draft.clearance
    if violated == "clearance":
        clear = 2.0 * draft.clearance
        expected += 0.5
    wanted = HullProblem(problem().surface, target, tolerance, least, leave, clear)
    shortfall = draft.shortfall(wanted)
    assert (shortfall == 0.0) == (not violated)
    assert shortfall == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("compiled", [True, False])
def test_the_jacobian_by_finite_differences(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not compiled:
        monkeypatch.setattr(kernels, "compiled", None)
    draft = original_draft(problem())
    direction = np.random.default_rng(4).normal(size=draft.corners.shape)
    step = 1e-8
    ahead, behind = (
        HullDraft.of(draft.corners + s * direction, draft.directions) for s in (step, -step)
    )
    expected = (ahead.probabilities - behind.probabilities) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(draft.jacobian, direction, 2), expected, rtol=1e-5)
    np.testing.assert_allclose(draft.jacobian.sum(axis=0), 0.0, atol=1e-12)


def test_a_draft_without_hull_or_outside_the_center_of_mass_is_none() -> None:
    draft = original_draft(problem())
    assert HullDraft.of(draft.corners + np.array([2.0, 0.0, 0.0]), draft.directions) is None
    flat = draft.corners * np.array([1.0, 1.0, 0.0])
    assert HullDraft.of(flat, draft.directions) is None


def test_exact_and_settled_drafts_have_the_probabilities_to_rounding() -> None:
    first, draft = drafts()
    assert exact_draft(problem(), first) is None
    near = HullDraft.of(draft.corners + 1e-4 * np.sin(9.0 * draft.corners), draft.normals)
    assert near.error(problem().target) > 1e-7
    for exact in (exact_draft(problem(), near), settle_draft(problem(), near)):
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
def test_designed_hulls_meet_all_limits(
    surface: Surface, target: list[float], apart_deg: float, margin_deg: float
) -> None:
    problem = problem_of(surface, target, apart_deg, margin_deg)
    design = make_designed_hull(problem, settle_draft(problem, design_draft(problem)))
    assert meets_limits(design, problem)
    assert judge(design)[1].error(problem.target) == pytest.approx(design.error, abs=1e-9)


def test_a_failed_design_returns_its_best_draft() -> None:
    """No three directions are 170 degrees apart."""
    problem = problem_of(bumpy_sphere(1), [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], 170.0)
    first = original_draft(problem)
    draft = design_hull(problem, first)
    assert 0.0 < draft.shortfall(problem) < first.shortfall(problem)


def test_vertices_of_a_designed_hull_are_moved_points_of_the_surface() -> None:
    problem = problem_of(bumpy_sphere(1), [0.6, 0.4])
    design = make_designed_hull(problem, design_draft(problem))
    place = np.full(len(problem.surface.points), -1)
    place[problem.source] = np.arange(len(problem.source))
    moved = design.moved[place[design.corners]] + design.center_of_mass
    expected = problem.surface.points[design.corners] + moved
    np.testing.assert_allclose(design.hull.vertices, expected, atol=1e-14)
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert len(design.corners) > 0.7 * len(problem.source)
    assert np.linalg.norm(moved, axis=1).mean() < 0.3


def test_easing_moves_corners_back_and_keeps_all_limits() -> None:
    design = make_designed_hull(problem(), good())
    places = problem().surface.points[:10]
    eased = relax_hull(problem(), design, places, 0.3)
    assert meets_limits(eased, problem())
    corners = problem().hull.vertices
    is_near = np.linalg.norm(corners[:, None] - places, axis=2).min(axis=1) < 0.3
    near, others = problem().source[is_near], problem().source[~is_near]
    held = HeldCorners(problem().elasticity, others)
    before, after = (
        np.linalg.norm(held.follow(moved[~is_near])[near] - moved[is_near])
        for moved in (design.moved, eased.moved)
    )
    assert after < 0.9 * before
    assert relax_hull(problem(), design, np.full((1, 3), 9.0), 0.3) is None


# By the paper's method.


@pytest.mark.parametrize("finish", ["exact", "none"])
def test_the_paper_s_descent_lowers_the_energy(finish: Literal["exact", "none"]) -> None:
    problem = problem_of(bumpy_sphere(1), [0.5, 0.5])
    energies: list[float] = []
    options = ConcavePaperOptions(finish=finish, steps=100)
    directions = choices_of(problem)[0]
    design = descend_hull(problem, directions, options, lambda energy, _: energies.append(energy))
    assert judge(design)[1].error(problem.target) == pytest.approx(design.error, abs=1e-9)
    assert min(energies) < energies[0]
    assert len(set(design.corners.tolist())) == len(design.corners)
    assert np.isin(design.corners, problem.source).all()


def test_the_paper_s_search_takes_the_best_hull() -> None:
    problem = problem_of(bumpy_sphere(1), [0.5, 0.5])
    choices = choices_of(problem)
    options, random = ConcavePaperOptions(steps=30), np.random.default_rng(1)
    design = search_hull(problem, choices, options, random, lambda *step: None, plain=True)
    first = descend_hull(problem, choices[0], options, lambda *step: None)
    error = judge(design)[1].error(problem.target)
    assert error <= max(problem.tolerance, first.error)
