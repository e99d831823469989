"""Hulls of a design and their elastic space, computed in other ways; hulls during and after their
design, judged by the forward model."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from common.bumpy import ball, bent_capsule, bumpy_sphere, unit
from common.kernels import without_kernels
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls
from scipy.spatial import ConvexHull as OtherHull
from scipy.spatial.distance import cdist, pdist

from dicedesign import rest_poses
from dicedesign.concave.complementarity import solve_complementarity
from dicedesign.concave.hull_design import design_hull
from dicedesign.concave.hull_draft import (
    HullDraft,
    exact_draft,
    make_designed_hull,
    relax_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import (
    CORNERS,
    HANDLES,
    KERNEL_CONSTANT,
    SAMPLES,
    DesignedHull,
    Elasticity,
    HeldCorners,
    HullProblem,
)
from dicedesign.concave.options import ConcavePaperOptions
from dicedesign.concave.outcome_directions import outcome_choices
from dicedesign.concave.paper_hull import descend_hull, search_hull
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import best_similarity
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import OutcomeProbabilities, outcome_margins, outcome_probabilities
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats

SHEAR = np.array([[1.0, 0.05, -0.03], [0.0, 1.0, 0.07], [0.0, 0.0, 1.0]])
"""Symmetric bodies have ties."""


def squashed_ball(subdivisions: int) -> Surface:
    """Ellipsoid, all of whose points are vertices of its hull."""
    surface = ball(subdivisions)
    return unit(surface.with_points(surface.points * np.array([1.0, 0.8, 0.3])))


@pytest.mark.parametrize("surface", [unit(bumpy_sphere(3)), squashed_ball(3)])
def test_corners_of_a_design_are_few_and_spread(surface: Surface) -> None:
    problem = HullProblem(surface, np.array([0.5, 0.5]), 0.004, coarse=True)
    corners, vertices = problem.hull.vertices, OtherHull(surface.points).vertices
    assert len(corners) == CORNERS < len(vertices)
    # No vertex is farther from all corners than they are from each other.
    assert cdist(surface.points[vertices], corners).min(axis=1).max() <= pdist(corners).min()
    np.testing.assert_array_equal(surface.points[problem.source], corners)
    assert np.isin(problem.source, vertices).all()
    fine = HullProblem(surface, np.array([0.5, 0.5]), 0.004)
    np.testing.assert_array_equal(np.sort(fine.source), np.sort(vertices))


@cache
def fine_problem() -> HullProblem:
    surface = bumpy_sphere()
    sheared = unit(surface.with_points(surface.points @ SHEAR))
    return HullProblem(sheared, np.array([0.5, 0.5]), 0.004)


@cache
def brute_force() -> tuple[Floats, Floats]:
    """(3 n, 3 n) displacements of all points for forces on them, and (3 c, 3 n) displacements of
    the corners relative to the center of mass, by finite differences."""
    surface, source, step = fine_problem().surface, fine_problem().source, 1e-5
    points = surface.points
    rows = np.zeros((len(source), 3, *points.shape))
    rows[np.arange(len(source))[:, None], np.arange(3), source[:, None], np.arange(3)] = 1.0
    for point, axis in np.ndindex(points.shape):
        shift = np.zeros_like(points)
        shift[point, axis] = step
        ahead = surface.with_points(points + shift).centroid
        behind = surface.with_points(points - shift).centroid
        rows[:, :, point, axis] -= (ahead - behind) / (2.0 * step)
    responses = np.kron(KERNEL_CONSTANT - cdist(points, points), np.eye(3))
    return responses, rows.reshape(3 * len(source), -1)


def forces_by_brute_force(moved: Floats) -> Floats:
    """(3 c,) forces of minimum work for displacements (c, 3) of the corners."""
    responses, rows = brute_force()
    return np.linalg.solve(rows @ responses @ rows.T, moved.ravel())


def displacement_of_all(moved: Floats) -> Floats:
    """(n, 3) displacement of minimum work for displacements (c, 3) of the corners."""
    responses, rows = brute_force()
    return (responses @ rows.T @ forces_by_brute_force(moved)).reshape(-1, 3)


def test_the_displacement_is_measured_after_alignment() -> None:
    points = fine_problem().surface.points
    moved = np.random.default_rng(0).normal(size=fine_problem().hull.vertices.shape)
    # Small enough for the linearization.
    there = points + 1e-5 * displacement_of_all(moved)
    back = best_similarity(there, points, np.ones(len(points)))
    distances = 1e5 * np.linalg.norm(back(there) - points, axis=1) / fine_problem().surface.diagonal
    expected = np.sqrt((distances**2).mean())
    assert fine_problem().displacement(moved) == pytest.approx(expected, rel=1e-3)
    assert fine_problem().mean_displacement(moved) == pytest.approx(distances.mean(), rel=1e-3)


def test_a_turned_and_enlarged_surface_is_displaced_little() -> None:
    """Also where samples stand for several points each: linear displacements of the corners are
    interpolated to a percent."""
    surface = unit(bumpy_sphere(3))
    assert len(surface.points) > SAMPLES
    problem = HullProblem(surface, np.array([0.5, 0.5]), 0.004, coarse=True)
    arms = problem.hull.vertices - surface.centroid
    for moved in (np.cross([1.0, 2.0, 3.0], arms), arms):
        size = np.sqrt((moved**2).sum(axis=1).mean()) / surface.diagonal
        assert problem.displacement(moved) < 0.02 * size
        assert problem.mean_displacement(moved) < 0.02 * size


def test_cavities_shift_the_center_where_the_surface_moves_least() -> None:
    """Corners that all move by the opposite of a shift stay where they are."""
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    solid, half = fine_problem(), 0.1
    problem = solid.with_room(convex_hull(half * box))
    within = half * np.array([0.3, -0.6, 0.8])
    still = np.broadcast_to(-within, problem.hull.vertices.shape)
    np.testing.assert_allclose(problem.shift(still), within, rtol=1e-5)
    assert problem.displacement(still) < 1e-6 < solid.displacement(still)
    assert problem.mean_displacement(still) < 1e-6 < solid.mean_displacement(still)
    moved = still + 0.05 * np.random.default_rng(1).normal(size=still.shape)
    for beyond in (0.0, half):
        there = moved - [beyond, 0.0, 0.0]
        shift = problem.shift(there)
        assert np.abs(shift).max() <= half * (1.0 + 1e-9)
        least = problem.displacement(there)
        assert least == pytest.approx(solid.displacement(there + shift), rel=1e-9)
        mean = solid.mean_displacement(there + shift)
        assert problem.mean_displacement(there) == pytest.approx(mean, rel=1e-9)
        for other in np.random.default_rng(2).uniform(-half, half, size=(50, 3)):
            assert solid.displacement(there + other) >= least
    designed = problem.designed(
        problem.hull.vertices, np.arange(len(moved)), moved, np.eye(3)[:2], 0.0
    )
    np.testing.assert_array_equal(designed.shift, problem.shift(moved))
    offset = designed.center_of_mass + designed.shift
    np.testing.assert_allclose(
        np.sort(designed.hull.vertices, axis=0),
        np.sort(problem.hull.vertices + offset, axis=0),
        atol=1e-12,
    )


def test_relative_forces_and_centers_by_brute_force() -> None:
    held, surface = fine_problem().held, fine_problem().surface
    wanted = 0.1 * np.random.default_rng(4).normal(size=(len(held.corners), 3))
    expected = forces_by_brute_force(wanted)
    forces, centers = held.relative
    np.testing.assert_array_equal(forces, forces.transpose(2, 3, 0, 1))
    np.testing.assert_allclose(
        np.tensordot(wanted, forces, 2).ravel(), expected, atol=1e-5 * np.abs(expected).max()
    )
    center = surface.centroid_derivatives().reshape(3, -1) @ displacement_of_all(wanted).ravel()
    np.testing.assert_allclose(np.tensordot(wanted, centers, 2), center, atol=1e-6)


def test_followed_displacements_have_minimum_work() -> None:
    held, points = fine_problem().held, fine_problem().surface.points
    wanted = np.random.default_rng(1).normal(size=(len(held.corners), 3))
    followed = held.follow(wanted)
    np.testing.assert_allclose(followed[held.corners], wanted, atol=1e-10)
    free = np.setdiff1d(np.arange(len(followed)), held.corners)
    forces = np.linalg.inv(KERNEL_CONSTANT - cdist(points, points)) @ followed
    assert np.abs(forces[free]).max() < 1e-8 * np.abs(forces).max()


def test_lumped_and_exact_forces_move_the_center_of_mass_similarly() -> None:
    surface = unit(bumpy_sphere(3))
    assert len(surface.points) > HANDLES
    elasticity = Elasticity(surface)
    gradient = np.moveaxis(surface.centroid_derivatives(), 0, -1)
    exact = np.tensordot(elasticity.responses(np.arange(len(gradient))), gradient, (1, 0))
    lumped = elasticity.center_responses(gradient)
    np.testing.assert_allclose(lumped, exact, atol=2e-3 * np.abs(exact).max())


def test_a_convex_surface_is_refused() -> None:
    convex = unit(ball(1))
    held = HeldCorners(Elasticity(convex), convex_hull(convex.points).source)
    text = "surface: expected one with dents, but 42 of its 42 points are corners of its hull, and"
    with pytest.raises(InputError, match=text):
        _ = held.relative


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


def test_exact_and_settled_drafts_have_the_probabilities_to_rounding() -> None:
    first, draft = drafts()
    assert exact_draft(problem(), first) is None
    near = HullDraft.of(draft.corners + 1e-4 * np.sin(9.0 * draft.corners), draft.normals)
    assert near.error(problem().target) > 1e-7
    for exact in (exact_draft(problem(), near), settle_draft(problem(), near)):
        poses = rest_poses(exact.rests.hull.vertices, center_of_mass=np.zeros(3))
        assert outcome_probabilities(poses, exact.normals).error(problem().target) < 1e-10


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
