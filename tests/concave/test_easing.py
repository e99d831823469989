"""Hulls that are eased: as good as before, and nearer to the original."""

from __future__ import annotations

from functools import cache

import numpy as np
from common.bumpy import bumpy_sphere
from common.hull_problems import SLOPES, designed, problem_of

from dicedesign import rest_poses
from dicedesign.concave.hull_design import (
    HullDraft,
    make_designed_hull,
    nearer_draft,
    relax_hull,
    settle_draft,
)
from dicedesign.concave.hull_problem import DesignedHull, HeldCorners, HullProblem
from dicedesign.rest.outcomes import outcome_margins, outcome_probabilities


@cache
def problem() -> HullProblem:
    return problem_of(bumpy_sphere(), [0.3, 0.5, 0.2], 60.0, 15.0)


@cache
def draft() -> HullDraft:
    return designed(problem())


def is_as_wanted(design: DesignedHull) -> bool:
    """By the forward model."""
    poses = rest_poses(design.hull.vertices, center_of_mass=design.center_of_mass)
    outcomes = outcome_probabilities(poses, design.directions)
    return bool(
        outcomes.error(problem().target) <= problem().tolerance
        and outcomes.least_angle >= problem().apart - 1e-9
        and outcome_margins(poses, outcomes).min() >= problem().margin - 1e-9
    )


def displacement(draft: HullDraft, problem: HullProblem) -> float:
    return problem.displacement(draft.corners - problem.hull.vertices)


def test_easing_takes_corners_back_and_nothing_gets_worse() -> None:
    design = make_designed_hull(problem(), draft())
    places = problem().surface.points[:10]
    eased = relax_hull(problem(), design, places, 0.3)
    assert eased is not None
    assert is_as_wanted(eased)
    corners = problem().hull.vertices
    away = np.linalg.norm(corners[:, None] - places, axis=2).min(axis=1)
    near, others = np.flatnonzero(away < 0.3), np.flatnonzero(away >= 0.3)
    held = HeldCorners(problem().elasticity, problem().source[others])
    off = [
        np.linalg.norm(held.follow(moved[others])[problem().source[near]] - moved[near])
        for moved in (design.moved, eased.moved)
    ]
    assert off[1] < 0.8 * off[0]
    far = np.array([[9.0, 9.0, 9.0]])
    assert relax_hull(problem(), design, far, 0.3) is None


def test_what_is_nearer_is_as_wanted() -> None:
    nearer = nearer_draft(problem(), draft(), SLOPES)
    assert is_as_wanted(make_designed_hull(problem(), nearer))
    assert nearer.shortfall(problem()) == 0.0
    # It moves: there is work to be saved, or slopes to be had.
    assert np.abs(nearer.corners - draft().corners).max() > 1e-6
    assert displacement(nearer, problem()) < displacement(draft(), problem())


def test_what_is_settled_has_the_probabilities_to_rounding() -> None:
    corners = draft().corners + 1e-4 * np.sin(9.0 * draft().corners)
    near = HullDraft.of(corners, draft().normals)
    assert near is not None
    settled = settle_draft(problem(), near)
    poses = rest_poses(settled.rests.hull.vertices, center_of_mass=np.zeros(3))
    assert outcome_probabilities(poses, settled.normals).error(problem().target) < 1e-10
    assert near.error(problem().target) > 1e-8
