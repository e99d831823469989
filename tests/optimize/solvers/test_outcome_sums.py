"""Dice of many faces whose outcomes have the target set down and thrown."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only

from dicedesign import rest_poses
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.optimize.solvers.outcome_sums import (
    PlanesInPairs,
    _Problem,
    arrange_outcomes,
    solve_outcome_sums,
)
from dicedesign.optimize.starts.face_bodies import even_codes, share_faces, weighted_code
from dicedesign.throws.momentum_probabilities import throw_probabilities

pytestmark = compiled_only

BOARD_GAME = ThrowProbabilities.on("board-game")


@pytest.mark.parametrize(("weights", "is_even"), [((5, 3, 2), True), ((7, 5, 3, 2, 2, 1), False)])
def test_outcomes_have_the_target_set_down_and_thrown(
    weights: tuple[int, ...], is_even: bool
) -> None:
    """Judged by the forward models of the corners, of which the one of throws is corrected by the
    bias of the faces."""
    target, faces = np.array(weights) / sum(weights), 24
    shared = share_faces(target, faces)
    code, outcome = weighted_code(shared.shares, 2), shared.outcome
    if is_even:
        code = even_codes()[faces]
        outcome = arrange_outcomes(target, shared, code, BOARD_GAME)
        assert np.array_equal(np.sort(outcome), np.sort(shared.outcome))
    die = solve_outcome_sums(target, outcome, code, BOARD_GAME)
    assert die is not None
    poses = rest_poses(die.hull.vertices)
    assert len(poses.probabilities) == faces
    face = np.argmax(poses.normals @ die.normals.T, axis=1)
    thrown = throw_probabilities(die.hull.vertices, poses)
    assert np.abs(np.bincount(outcome[face], poses.probabilities) - target).max() < 1e-9
    corrected = np.bincount(outcome[face], thrown * np.exp(code.bias[face]))
    # The solver scales them to a sum of 1 in each hand, not in the mean.
    assert np.abs(corrected / corrected.sum() - target).max() < (1e-6 if is_even else 1e-9)
    # Single faces differ, so that these are two conditions.
    assert np.abs(thrown - poses.probabilities).max() > 1e-4
    np.testing.assert_allclose(die.normals[: faces // 2], -die.normals[faces // 2 :])


def test_rare_outcomes_are_reached_by_shortened_steps() -> None:
    """Faces of a hundredth each turn over their edges, where whole steps lead past the target."""
    target = np.array([100.0, 1.0, 1.0]) / 102.0
    shared = share_faces(target, 12)
    die = solve_outcome_sums(target, shared.outcome, weighted_code(shared.shares, 2), BOARD_GAME)
    assert die is not None
    assert die.error < 1e-9
    poses = rest_poses(die.hull.vertices)
    face = np.argmax(poses.normals @ die.normals.T, axis=1)
    sums = np.bincount(shared.outcome[face], poses.probabilities)
    np.testing.assert_allclose(sums, target, atol=1e-9)


def test_slopes_agree_with_difference_quotients() -> None:
    """At a shape with short edges, and feet of the center near the ends of edges."""
    target = np.array([0.5, 0.3, 0.2])
    shared = share_faces(target, 16)
    code = weighted_code(shared.shares, 1)
    rng, step = np.random.default_rng(0), 1e-6
    # Symmetric bodies have kinks.
    planes = PlanesInPairs(code.normals[:8], np.log(code.distances) + 0.01 * rng.normal(size=16))
    bias = 0.1 * rng.normal(size=16)
    problem = _Problem(target, shared.outcome, planes, BOARD_GAME, True, bias)
    terms = problem.terms(planes)
    assert terms is not None
    # Faces set down and thrown, hands, edges and feet, moves.
    assert len(terms.soft) - 2 * 16 - 3 * len(problem.hands) - 40 == 6
    for along in rng.normal(size=(3, 32)):
        ends = [problem.terms(planes.move(sign * step * along), False) for sign in (1, -1)]
        for name in ("soft", "hard"):
            ahead, behind = (getattr(end, name) for end in ends)
            slopes = getattr(terms, f"{name}_slopes") @ along
            np.testing.assert_allclose((ahead - behind) / (2.0 * step), slopes, atol=2e-6)
