"""Hulls during and after their design, judged by the forward model of the same hull; the quadratic
programs of the design."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from common.bumpy import bent_capsule, bumpy_sphere, unit
from common.kernels import without_kernels
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import ConvexHull as OtherHull

from dicedesign import rest_poses
from dicedesign.concave.complementarity import solve_complementarity
from dicedesign.concave.hull_design import design_hull, edge_depths
from dicedesign.concave.hull_draft import (
    HullDraft,
    exact_draft,
    make_designed_hull,
    relax_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import DesignedHull, HeldCorners, HullProblem
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.concave.paper_hull import descend_hull, search_hull
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_margins, outcome_probabilities
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats

SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])
"""Symmetric bodies have ties."""


def problem_of(
    surface: Surface,
    target: list[float],
    apart_deg: float = 45.0,
    margin_deg: float = 10.0,
    clearance: float = 0.002,
) -> HullProblem:
    """Problem of a sheared surface."""
    return HullProblem(
        unit(surface.with_points(surface.points @ SHEAR)),
        np.array(target),
        0.004,
        float(np.radians(apart_deg)),
        float(np.radians(margin_deg)),
        clearance,
        coarse=True,
    )


def choices_of(problem: HullProblem) -> list[Floats]:
    """Choices of directions at the required angles."""
    return outcome_choices(problem.hull, problem.target, problem.apart, 0)


def original_draft(problem: HullProblem) -> HullDraft:
    """Hull of the surface, with the first choice of directions."""
    draft = HullDraft.of(problem.hull.vertices, choices_of(problem)[0])
    assert draft is not None
    return draft


def design_draft(problem: HullProblem, works: list[float]) -> HullDraft:
    """Hull without a shortfall, for the first choice of directions that leads to one. works: gets
    the work after each step."""
    for directions in choices_of(problem):
        works.clear()
        first = HullDraft.of(problem.hull.vertices, directions)
        draft = design_hull(problem, first, lambda work, error: works.append(work))
        if draft.shortfall(problem) == 0.0:
            return draft
    raise AssertionError("no choice of directions leads to a hull without a shortfall")


@cache
def problem() -> HullProblem:
    return problem_of(bumpy_sphere(), [0.3, 0.5, 0.2], 60.0, 15.0)


@cache
def drafts() -> tuple[HullDraft, HullDraft]:
    """A draft with many rests, and one with only the rests of its outcomes."""
    first, good = original_draft(problem()), design_draft(problem(), [])
    assert len(first.of_rest) > len(problem().target)
    assert (first.alone, good.alone) == (False, True)
    return first, good


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


# Drafts.


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


def test_the_clearance_of_a_draft_is_the_least_distance_of_a_foot_from_the_rim_of_its_facet() -> (
    None
):
    crowded, draft = drafts()
    assert crowded.clearance == 0.0
    hull = OtherHull(draft.corners)
    normals, heights = hull.equations[:, :3], -hull.equations[:, 3]
    cosines, distances = normals @ draft.normals.T, []
    for place, (normal, height) in enumerate(zip(normals, heights, strict=True)):
        corners = draft.corners[hull.simplices[place]]
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
    _, draft = drafts()
    target = problem().target
    tolerance = max(1.01 * draft.error(target), 1e-6)
    apart, margin, clearance = 0.99 * draft.apart, 0.99 * draft.margin, 0.99 * draft.clearance
    expected = 0.0
    if "probabilities" in violated:
        target = target + np.array([0.02, -0.01, -0.01])
        tolerance = 0.8 * draft.error(target)
        expected += 0.25
    if "apart" in violated:
        apart = 1.25 * draft.apart
        expected += 0.2
    if "margin" in violated:
        margin = 2.0 * draft.margin
        expected += 0.5
    if "clearance" in violated:
        clearance = 2.0 * draft.clearance
        expected += 0.5
    wanted = HullProblem(problem().surface, target, tolerance, apart, margin, clearance)
    shortfall = draft.shortfall(wanted)
    assert (shortfall == 0.0) == (not violated)
    assert shortfall == pytest.approx(expected, abs=1e-9)


def jacobian_and_differences() -> None:
    draft = original_draft(problem())
    direction = np.random.default_rng(4).normal(size=draft.corners.shape)
    step = 1e-8
    ahead, behind = (
        HullDraft.of(draft.corners + s * direction, draft.directions) for s in (step, -step)
    )
    expected = (ahead.probabilities - behind.probabilities) / (2.0 * step)
    np.testing.assert_allclose(np.tensordot(draft.jacobian, direction, 2), expected, rtol=1e-5)
    np.testing.assert_allclose(draft.jacobian.sum(axis=0), 0.0, atol=1e-12)


def test_the_jacobian_by_finite_differences() -> None:
    jacobian_and_differences()
    with without_kernels():
        jacobian_and_differences()


def test_a_draft_without_hull_or_outside_the_center_of_mass_is_none() -> None:
    draft, _ = drafts()
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


# Quadratic programs.


def test_depths_change_as_their_derivatives_say() -> None:
    """Central differences, and the depths of facets by another way: the least of their edges."""
    draft, random = drafts()[0], np.random.default_rng(0)
    hull = draft.rests.hull
    depths, slopes, corners = edge_depths(hull)
    radius = np.linalg.norm(hull.vertices, axis=1).max()
    np.testing.assert_allclose(
        np.minimum.reduceat(depths, hull.facet_start[:-1]) / radius, draft.rests.depths, atol=1e-12
    )
    change = random.normal(size=hull.vertices.shape)
    sides = []
    for step in (-1e-6, 1e-6):
        sides.append(edge_depths(replace(hull, vertices=hull.vertices + step * change))[0])
    expected = (slopes * change[corners]).sum((-2, -1))
    # A facet with more corners stays none when they move.
    triangles = (np.diff(hull.facet_start) == 3)[hull.facet]
    differences = (sides[1] - sides[0]) / 2e-6
    np.testing.assert_allclose(differences[triangles], expected[triangles], rtol=1e-5, atol=1e-5)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(0, 3))
def test_a_quadratic_program_against_least_squares(seed: int, bounds: int, equations: int) -> None:
    """The least displacement under the bounds is the projection that nonnegative least squares find
    too, with equations as two bounds."""
    random = np.random.default_rng(seed)
    conditions = random.normal(size=(bounds + equations, bounds + equations + 3))
    inside = random.normal(size=conditions.shape[1])
    values = conditions @ inside
    values[:bounds] += random.uniform(0.0, 1.0, bounds)
    strengths = solve_complementarity(
        conditions @ conditions.T, values, np.zeros(bounds, dtype=bool)
    )
    found = conditions.T @ strengths
    # Lawson and Hanson: the least x with G x >= h from the residual of a problem of least squares.
    g = np.concatenate([-conditions, conditions[bounds:]])
    h = np.concatenate([-values, values[bounds:]])
    system = np.concatenate([g.T, h[None]])
    wanted = np.zeros(len(system))
    wanted[-1] = 1.0
    residual = system @ nnls(system, wanted)[0] - wanted
    np.testing.assert_allclose(found, -residual[:-1] / residual[-1], atol=1e-6)


# Designs.


@pytest.mark.parametrize(
    ("surface", "target", "angles", "clearance"),
    [
        (bumpy_sphere(), [0.3, 0.5, 0.2], (60.0, 15.0), 0.005),
        (bumpy_sphere(), [0.2, 0.5, 0.3], (70.0, 0.0), 0.0),
        (bent_capsule(18, 10), [0.5, 0.5], (0.0, 0.0), 0.002),
    ],
)
def test_designs_meet_all_limits_and_are_nearer_to_the_original_than_first_solutions(
    surface: Surface, target: list[float], angles: tuple[float, float], clearance: float
) -> None:
    problem = problem_of(surface, target, *angles, clearance)
    works: list[float] = []
    draft = design_draft(problem, works)
    # The rests of another hull of the same corners.
    again = HullDraft.of(convex_hull(draft.corners).vertices, draft.directions)
    assert again is not None
    np.testing.assert_allclose(again.probabilities, problem.target, atol=problem.tolerance)
    moved = problem.displacement(draft.corners - problem.hull.vertices)
    assert moved**2 < 0.8 * max(works)
    design = make_designed_hull(problem, settle_draft(problem, draft))
    assert meets_limits(design, problem)
    assert judge(design)[1].error(problem.target) == pytest.approx(design.error, abs=1e-9)


def test_a_firm_design_keeps_its_foot_farther_from_rims() -> None:
    """The least depth of an outcome, and the least distance of other facets from being rests."""
    problem = problem_of(bumpy_sphere(), [0.5, 0.5], clearance=0.005)
    usual, firm = (
        design_hull(problem, original_draft(problem), firmness=firmness) for firmness in (1.0, 2.0)
    )
    assert firm.shortfall(problem) == 0.0
    assert firm.rests.depths[firm.facets].min() > usual.rests.depths[usual.facets].min()


def test_a_failed_design_returns_its_best_draft() -> None:
    """No three directions are 170 degrees apart."""
    problem = problem_of(bumpy_sphere(1), [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0], 170.0)
    first = original_draft(problem)
    draft = design_hull(problem, first)
    assert 0.0 < draft.shortfall(problem) < first.shortfall(problem)


def test_vertices_of_a_designed_hull_are_moved_points_of_the_surface() -> None:
    design = make_designed_hull(problem(), drafts()[1])
    points, source = problem().surface.points, problem().source
    place = np.full(len(points), -1)
    place[source] = np.arange(len(source))
    moved = design.moved[place[design.corners]] + design.center_of_mass
    np.testing.assert_allclose(design.hull.vertices, points[design.corners] + moved, atol=1e-14)
    assert len(set(design.corners.tolist())) == len(design.corners) > 0.7 * len(source)
    assert np.linalg.norm(moved, axis=1).mean() < 0.3


def test_easing_moves_corners_back_and_keeps_all_limits() -> None:
    design = make_designed_hull(problem(), drafts()[1])
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


def test_the_paper_s_descent_lowers_the_energy_and_its_search_takes_the_best_hull() -> None:
    problem = problem_of(bumpy_sphere(1), [0.5, 0.5])
    choices, random = choices_of(problem), np.random.default_rng(1)
    energies: list[float] = []
    options = ConcavePaperOptions(finish="none", steps=30)
    first = descend_hull(problem, choices[0], options, lambda energy, _: energies.append(energy))
    assert judge(first)[1].error(problem.target) == pytest.approx(first.error, abs=1e-9)
    assert min(energies) < energies[0]
    assert len(set(first.corners.tolist())) == len(first.corners)
    assert np.isin(first.corners, problem.source).all()
    best = search_hull(problem, choices, options, random, lambda *step: None, plain=True)
    assert judge(best)[1].error(problem.target) <= max(problem.tolerance, first.error)
    exact = descend_hull(problem, choices[0], ConcavePaperOptions(steps=100), lambda *step: None)
    assert judge(exact)[1].error(problem.target) == pytest.approx(exact.error, abs=1e-9)
