"""Derivatives of probabilities under priors, against differences of the forward model and each
other."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import dicedesign as dd
from dicedesign.gradient.probability_model import ProbabilitiesUnderPrior
from dicedesign.runtime.arrays import Floats

RNG = np.random.default_rng(5)
POINTS = RNG.normal(size=(14, 3))
POINTS /= np.linalg.norm(POINTS, axis=1)[:, None]
CENTER = np.array([0.03, 0.02, -0.05])
AXIS = RNG.normal(size=3)
PRIORS = {
    "vmf": dd.VonMisesFisher(AXIS, 4.0),
    "narrow": dd.VonMisesFisher(AXIS, 300.0),
    "cap": dd.SphericalCap(AXIS, 40.0),
    "function": dd.DensityFunction(lambda u: 1.0 + u[:, 0] ** 2 + 0.5 * u[:, 1]),
}
STEP = 1e-6


def probabilities_at(
    normals: Floats, points: Floats, center: Floats | None, prior: dd.Prior
) -> Floats:
    """(k,) probabilities of the rests with these normals, by the forward model."""
    poses = dd.rest_poses(points, "hull" if center is None else center).under(prior)
    return poses.probabilities[np.argmax(normals @ poses.normals.T, axis=1)]


@pytest.mark.parametrize("center", [None, CENTER])
@pytest.mark.parametrize("name", PRIORS)
def test_gradients_are_differences(name: str, center: Floats | None) -> None:
    prior = PRIORS[name]
    points = torch.tensor(POINTS, requires_grad=True)
    given = None if center is None else torch.tensor(center, requires_grad=True)
    normals, probabilities = dd.differentiable_rest(points, given, prior=prior)
    down = normals.detach().numpy()
    np.testing.assert_allclose(
        probabilities.detach(), probabilities_at(down, POINTS, center, prior), atol=1e-14
    )
    weights = RNG.normal(size=len(probabilities))
    (probabilities @ torch.from_numpy(weights)).backward()
    move, shift = RNG.normal(size=POINTS.shape), RNG.normal(size=3)
    ends = []
    for side in (STEP, -STEP):
        moved = None if center is None else center + side * shift
        ends.append(weights @ probabilities_at(down, POINTS + side * move, moved, prior))
    expected = (ends[0] - ends[1]) / (2.0 * STEP)
    assert points.grad is not None
    slope = float((points.grad.numpy() * move).sum())
    if given is not None:
        assert given.grad is not None
        slope += float(given.grad.numpy() @ shift)
    assert slope == pytest.approx(expected, abs=2e-8)
    assert abs(expected) > 1e-3


@pytest.mark.parametrize("name", PRIORS)
def test_the_jacobian_has_the_gradients_as_rows(name: str) -> None:
    model = ProbabilitiesUnderPrior.of(PRIORS[name])
    points = torch.tensor(POINTS, requires_grad=True)
    rests = dd.evaluate_rests(points)
    rows = model.jacobian(rests)
    for row, value in zip(rows, model.tensor(rests), strict=True):
        (gradient,) = torch.autograd.grad(value, points, retain_graph=True)
        hull = gradient.numpy()[rests.hull.source]
        np.testing.assert_allclose(row, hull.ravel(), atol=1e-13)
    # The probabilities sum to 1, and stay what they are as the body moves or grows.
    np.testing.assert_allclose(rows.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(rows @ rests.hull.vertices.ravel(), 0.0, atol=1e-12)
    np.testing.assert_allclose(rows.reshape(len(rows), -1, 3).sum(axis=1), 0.0, atol=1e-12)


@pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated")
def test_forward_mode_is_the_jacobian_and_second_derivatives_are_unknown() -> None:
    def probabilities(points: torch.Tensor) -> torch.Tensor:
        return dd.differentiable_rest(points, prior=PRIORS["vmf"])[1]

    points, move = torch.tensor(POINTS), torch.from_numpy(RNG.normal(size=POINTS.shape))
    _, tangent = torch.func.jvp(probabilities, (points,), (move,))
    rows = torch.autograd.functional.jacobian(probabilities, points)
    np.testing.assert_allclose(tangent, (rows * move).sum((1, 2)), atol=1e-12)
    hessian = torch.autograd.functional.hessian(lambda x: probabilities(x)[0], points)
    assert torch.isnan(hessian).any()
