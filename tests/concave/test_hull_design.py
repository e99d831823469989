"""Design of hulls by quadratic programs: their bounds, their solutions, and what they reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.bumpy import bumpy_sphere
from common.hull_problems import original_draft, problem_of
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

from dicedesign.concave.complementarity import solve_complementarity
from dicedesign.concave.hull_design import design_hull, edge_depths
from dicedesign.concave.hull_draft import HullDraft
from dicedesign.geometry.hulls.hull import convex_hull


def test_depths_change_as_their_derivatives_say() -> None:
    """Central differences, and the depths of facets by another way: the least of their edges."""
    problem = problem_of(bumpy_sphere(), [0.5, 0.5])
    draft = original_draft(problem)
    hull, random = draft.rests.hull, np.random.default_rng(0)
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


@pytest.mark.parametrize("clearance", [0.0, 0.005])
def test_a_design_meets_all_limits_and_is_nearer_to_the_original_than_its_first_solution(
    clearance: float,
) -> None:
    problem = problem_of(bumpy_sphere(), [0.3, 0.5, 0.2], 60.0, 15.0, clearance)
    works: list[float] = []
    first = original_draft(problem)
    draft = design_hull(problem, first, lambda work, error: works.append(work))
    assert draft.shortfall(problem) == 0.0
    # The rests of another hull of the same corners.
    again = HullDraft.of(convex_hull(draft.corners).vertices, draft.directions)
    assert again is not None
    np.testing.assert_allclose(again.probabilities, problem.target, atol=problem.tolerance)
    moved = problem.displacement(draft.corners - problem.hull.vertices)
    assert moved**2 < 0.8 * max(works)


def test_a_firm_design_keeps_its_foot_farther_from_rims() -> None:
    """The least depth of an outcome, and the least distance of other facets from being rests."""
    problem = problem_of(bumpy_sphere(), [0.5, 0.5], clearance=0.005)
    usual, firm = (
        design_hull(problem, original_draft(problem), firmness=firmness) for firmness in (1.0, 2.0)
    )
    assert firm.shortfall(problem) == 0.0
    assert firm.rests.depths[firm.facets].min() > usual.rests.depths[usual.facets].min()
