"""Probabilities of thrown bodies by the momentum model, compiled and by its formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from common.kernels import compiled_only, without_kernels
from common.stones import both_ways
from numpy.typing import NDArray

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.momentum_probabilities import (
    landing_probabilities,
    momentum_probabilities,
)
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.transition_features import Transitions, body_features
from tests.reference import solids

Floats = NDArray[np.float64]

BOARD_GAME = ThrowProbabilities.on("board-game")


def random_points(seed: int, count: int) -> Floats:
    """Points between two concentric spheres."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return np.asarray(points * rng.uniform(0.85, 1.15, size=(count, 1)))


BODIES: dict[str, Callable[[], Floats]] = {
    "random": lambda: random_points(13, 13),
    "many rests": lambda: random_points(3, 150),
    "two saddles between two rests": lambda: random_points(5, 10) * [1.0, 1.0, 0.5],
    "box": lambda: solids.box(1.0, 1.3, 1.7).points,
    "elsewhere": lambda: 1e3 * random_points(5, 12) + [2e3, -1e3, 5e2],
}

NO_GRADIENTS = ("many rests", "box")
"""Names of bodies that take long, or whose corners are equally far from a hinge, so that only
one-sided derivatives exist."""


def assert_near(actual: Floats, expected: Floats, tolerance: float) -> None:
    """Relative to the largest entry."""
    assert actual.shape == expected.shape
    assert np.abs(actual - expected).max() <= tolerance * np.abs(expected).max()


@compiled_only
@pytest.mark.parametrize("name", BODIES)
def test_kernels_against_the_formulas(name: str) -> None:
    for rests in both_ways(BODIES[name]()):
        probabilities = BOARD_GAME.probabilities(rests)
        with without_kernels():
            expected = BOARD_GAME.probabilities(rests)
        assert np.abs(probabilities - expected).max() < 1e-12
        assert probabilities.min() >= 0.0
        assert probabilities.sum() == pytest.approx(1.0, abs=1e-12)
        assert np.abs(probabilities - rests.probability_values).max() > 1e-6
        by_torch = BOARD_GAME._formula(
            rests, rests.vertices, rests.center_of_mass, rests.probabilities
        )
        assert np.abs(probabilities - by_torch.detach().numpy()).max() < 1e-12
        tensor = BOARD_GAME.tensor(rests)
        assert np.array_equal(tensor.detach().numpy(), probabilities)
        if name in NO_GRADIENTS:
            continue
        leaves = [rests.vertices] + ([] if rests.given_center is None else [rests.given_center])
        weights = torch.linspace(-1.0, 1.0, len(probabilities), dtype=torch.float64)
        compiled, expected = (
            torch.autograd.grad((value * weights).sum(), leaves, retain_graph=True)
            for value in (tensor, by_torch)
        )
        for mine, other in zip(compiled, expected, strict=True):
            assert_near(mine.numpy(), other.numpy(), 1e-10)


def test_one_rest_is_always_reached() -> None:
    # A ball with its weight near one facet.
    points = np.random.default_rng(2).normal(size=(20, 3))
    hull = convex_hull(points / np.linalg.norm(points, axis=1)[:, None])
    center = 0.9 * hull.vertices[hull.tail[: hull.facet_start[1]]].mean(axis=0)
    vertices = torch.tensor(hull.vertices, requires_grad=True)
    rests = RestEvaluation(classify(hull, center), vertices, torch.tensor(center))
    assert BOARD_GAME.tensor(rests).detach().numpy() == pytest.approx([1.0])
    assert np.abs(BOARD_GAME.jacobian(rests)).max() < 1e-12
    with without_kernels():
        assert BOARD_GAME.probabilities(rests) == pytest.approx([1.0])


def test_without_momentum_or_with_one_rest_throws_are_as_set_down() -> None:
    model = momentum_model("board-game")
    points = random_points(13, 13)
    hull = convex_hull(points)
    center = 0.95 * hull.vertices[hull.tail[: hull.facet_start[1]]].mean(axis=0)
    for given, mixture, rests in ((None, None, 8), (center, None, 1), (center, model, 1)):
        poses = rest_poses(points, given)
        body = rigid_body(make_body(points), poses)
        assert (len(poses.facets) == 1) == (rests == 1)
        thrown = momentum_probabilities(poses, body, mixture)
        np.testing.assert_array_equal(thrown, poses.probabilities)


@compiled_only
def test_a_tied_body_has_the_probabilities_of_both_sides() -> None:
    rng = np.random.default_rng(4)
    tied = 0
    while tied < 2:
        points = rng.integers(-2, 3, size=(8, 3)).astype(np.float64)
        poses = rest_poses(points)
        if len(poses.basins) == 1:
            continue
        tied += 1
        body = rigid_body(make_body(points), poses)
        probabilities = momentum_probabilities(poses, body, BOARD_GAME.mixture)
        with without_kernels():
            expected = momentum_probabilities(poses, body, BOARD_GAME.mixture)
        # Barriers as low as the center is moved aside are known to a few digits.
        assert probabilities == pytest.approx(expected, abs=1e-4)
        assert probabilities.sum() == pytest.approx(1.0, abs=1e-12)


def test_negative_barriers_by_rounding_count_as_zero() -> None:
    hull = convex_hull(random_points(8, 8))
    rests = RestEvaluation(classify(hull, hull.centroid), torch.tensor(hull.vertices))
    assert BOARD_GAME.mixture is not None
    inertia = hull.surface.inertia
    transitions = Transitions.of(hull, rests.paths)
    known = hull.vertices, hull.centroid, inertia, rests.probability_values, np
    features, probabilities = body_features(transitions, *known), []
    for height in (-1e-16, 0.0, 1e-16, 1e-12):
        barriers = np.append(height, features.barriers[1:])
        changed, model = replace(features, barriers=barriers), BOARD_GAME.mixture.models[0]
        probabilities.append(landing_probabilities(changed, transitions, model, np))
    assert np.isfinite(probabilities).all()
    assert np.abs(np.array(probabilities) - probabilities[0]).max() < 1e-6
