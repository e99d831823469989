"""Probabilities of thrown bodies with gradients, and dice led to them."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.differentiable_rest import differentiable_rest
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.momentum_probabilities import throw_probabilities

POINTS = np.random.default_rng(5).normal(size=(9, 3))


def test_probabilities_are_those_of_the_forward_model() -> None:
    _, probabilities = differentiable_rest(torch.tensor(POINTS), table="board-game")
    poses = rest_poses(POINTS, "hull")
    expected = throw_probabilities(make_body(POINTS), poses)
    np.testing.assert_allclose(np.sort(probabilities.numpy()), np.sort(expected), atol=1e-12)
    assert np.abs(np.sort(poses.probabilities) - np.sort(expected)).max() > 0.01
    assert (np.diff(probabilities.numpy()) <= 0.0).all()


@pytest.mark.parametrize("given", [False, True])
def test_gradients_are_those_of_differences(given: bool) -> None:
    center = POINTS.mean(0) if given else None

    def probabilities(points: np.ndarray) -> np.ndarray:
        at = None if center is None else torch.tensor(center)
        return differentiable_rest(torch.tensor(points), at, table="board-game")[1].numpy()

    leaf = torch.tensor(POINTS, requires_grad=True)
    at = None if center is None else torch.tensor(center)
    value = differentiable_rest(leaf, at, table="board-game")[1]
    weights = np.linspace(-1.0, 1.0, len(value))
    (gradient,) = torch.autograd.grad(value @ torch.tensor(weights), leaf)
    direction = np.random.default_rng(1).normal(size=POINTS.shape)
    step = 1e-6
    difference = (
        probabilities(POINTS + step * direction) - probabilities(POINTS - step * direction)
    ) @ weights
    expected = float((gradient.numpy() * direction).sum())
    assert difference / (2.0 * step) == pytest.approx(expected, rel=1e-6)


def test_an_unknown_table_is_an_error() -> None:
    with pytest.raises(InputError, match="table glass: expected board-game"):
        differentiable_rest(torch.tensor(POINTS), table="glass")
