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
from dicedesign.geometry.triangles import solid_inertia
from dicedesign.gradient.probability_model import ThrowProbabilities
from dicedesign.gradient.rest_probabilities import RestEvaluation
from dicedesign.rest.equilibria import classify
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum_probabilities import (
    landing_probabilities,
    mixture_probabilities,
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


def coin() -> Floats:
    """Plate with two parallel rests and two saddles between them, on opposite sides."""
    outline = np.array([[1.0, 0.1], [0.1, 0.8], [-0.9, 0.2], [-0.15, -0.7], [0.6, -0.5]])
    lower = np.column_stack([outline, np.full(5, -0.2)])
    upper = np.column_stack([0.8 * outline, np.full(5, 0.15)])
    return np.concatenate([lower, upper])


# Corners at equal distances: only one-sided derivatives exist.
WITH_TIES = ("coin", "box")

BODIES: dict[str, Callable[[], Floats]] = {
    **{f"random {n}": lambda n=n: random_points(n, n) for n in (8, 13)},
    "many rests": lambda: random_points(3, 150),
    "two saddles between two rests": lambda: random_points(5, 10) * [1.0, 1.0, 0.5],
    "coin": coin,
    "box": lambda: solids.box(1.0, 1.3, 1.7).points,
    "elsewhere": lambda: 1e3 * random_points(5, 12) + [2e3, -1e3, 5e2],
}


@pytest.fixture(params=BODIES)
def points(request: pytest.FixtureRequest) -> Floats:
    return BODIES[request.param]()


@pytest.fixture(params=[name for name in BODIES if name not in WITH_TIES])
def smooth_points(request: pytest.FixtureRequest) -> Floats:
    return BODIES[request.param]()


def leaves(rests: RestEvaluation) -> list[torch.Tensor]:
    return [rests.vertices] + ([] if rests.given_center is None else [rests.given_center])


def gradients(value: torch.Tensor, rests: RestEvaluation, **how: bool) -> list[torch.Tensor]:
    return list(torch.autograd.grad(value, leaves(rests), retain_graph=True, **how))


def assert_near(actual: Floats, expected: Floats, tolerance: float) -> None:
    """Relative to the largest entry."""
    assert actual.shape == expected.shape
    size = float(np.abs(expected).max())
    assert float(np.abs(actual - expected).max()) <= tolerance * size


@compiled_only
def test_kernel_probabilities_against_the_formulas(points: Floats) -> None:
    for rests in both_ways(points):
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
        assert np.array_equal(BOARD_GAME.tensor(rests).detach().numpy(), probabilities)


@compiled_only
def test_kernel_gradients_against_the_formulas(smooth_points: Floats) -> None:
    for rests in both_ways(smooth_points):
        if len(rests.probability_values) > 50:
            continue
        weights = torch.linspace(-1.0, 1.0, len(rests.probability_values), dtype=torch.float64)
        compiled = gradients((BOARD_GAME.tensor(rests) * weights).sum(), rests)
        formula = BOARD_GAME._formula(
            rests, rests.vertices, rests.center_of_mass, rests.probabilities
        )
        expected = gradients((formula * weights).sum(), rests)
        for mine, other in zip(compiled, expected, strict=True):
            assert_near(mine.numpy(), other.numpy(), 1e-10)


@pytest.mark.parametrize("name", ["random 8", "random 13", "two saddles between two rests"])
def test_the_jacobian_against_finite_differences(name: str) -> None:
    hull = convex_hull(BODIES[name]())
    vertices = torch.tensor(hull.vertices)
    jacobian = BOARD_GAME.jacobian(RestEvaluation(classify(hull, hull.centroid), vertices))
    step = 1e-6

    def probabilities(moved: Floats) -> Floats:
        after = convex_hull(moved)
        rests = RestEvaluation(classify(after, after.centroid), torch.tensor(after.vertices))
        # The facets of a moved hull may come in another order.
        order = np.lexsort(np.round(after.normals[rests.paths.rests], 3).T)
        return BOARD_GAME.probabilities(rests)[order]

    rests = RestEvaluation(classify(hull, hull.centroid), vertices).paths.rests
    order = np.lexsort(np.round(hull.normals[rests], 3).T)
    rng = np.random.default_rng(1)
    for _ in range(4):
        way = rng.normal(size=hull.vertices.shape)
        after, before = (probabilities(hull.vertices + sign * step * way) for sign in (1.0, -1.0))
        slope = (jacobian @ way.ravel())[order]
        assert_near((after - before) / (2.0 * step), slope, 1e-6)


def test_one_rest_is_always_reached() -> None:
    # A ball with its weight near one facet.
    points = np.random.default_rng(2).normal(size=(20, 3))
    hull = convex_hull(points / np.linalg.norm(points, axis=1)[:, None])
    center = 0.9 * hull.vertices[hull.tail[: hull.facet_start[1]]].mean(axis=0)
    vertices = torch.tensor(hull.vertices, requires_grad=True)
    rests = RestEvaluation(classify(hull, center), vertices, torch.tensor(center))
    assert BOARD_GAME.probabilities(rests) == pytest.approx([1.0])
    assert BOARD_GAME.tensor(rests).detach().numpy() == pytest.approx([1.0])
    assert np.abs(BOARD_GAME.jacobian(rests)).max() < 1e-12
    assert BOARD_GAME.mixture is not None
    inertia = solid_inertia(hull.vertices, hull.triangles)
    probabilities = mixture_probabilities(
        hull, rests.paths, center, inertia, np.ones(1), BOARD_GAME.mixture
    )
    assert probabilities == pytest.approx([1.0])


@compiled_only
def test_a_tied_body_has_the_probabilities_of_both_sides() -> None:
    rng = np.random.default_rng(4)
    tied = 0
    while tied < 5:
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
    model, *_ = BOARD_GAME.mixture.models
    inertia = solid_inertia(hull.vertices, hull.triangles)
    transitions = Transitions.of(hull, rests.paths)
    features = body_features(
        transitions, hull.vertices, hull.centroid, inertia, rests.probability_values, np
    )
    probabilities = []
    for height in (-1e-16, 0.0, 1e-16, 1e-12):
        barriers = np.where(np.arange(len(features.barriers)) == 0, height, features.barriers)
        probabilities.append(
            landing_probabilities(replace(features, barriers=barriers), transitions, model, np)
        )
    assert np.isfinite(probabilities).all()
    assert np.abs(np.array(probabilities) - probabilities[0]).max() < 1e-6
