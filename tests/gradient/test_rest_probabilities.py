"""The differentiable model, also under priors: values of the forward model, and differences."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import dicedesign as dd
from dicedesign import rest_poses
from dicedesign.geometry.meshes.body import make_body
from dicedesign.gradient.differentiable_rest import differentiable_rest
from dicedesign.gradient.probability_model import ProbabilitiesUnderPrior
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.clusters import ClusteredRests
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum_probabilities import throw_probabilities
from tests.reference.stiff import off_balance

CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def leaf(values: np.ndarray) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)


def inside(points: np.ndarray, seed: int) -> np.ndarray:
    """A point near the centroid of the hull, but not there."""
    weights = np.random.default_rng(seed).dirichlet(np.full(len(points), 3.0))
    return 0.6 * rest_poses(points).center_of_mass + 0.4 * weights @ points


def test_gradcheck_in_vertices_and_center(random_points) -> None:
    """And of uniform solids."""
    for count in (4, 6, 9, 14, 20):
        points = random_points(count, count)
        for leaves in ((leaf(points), leaf(inside(points, count))), (leaf(points),)):
            assert torch.autograd.gradcheck(
                differentiable_rest, leaves, eps=1e-6, atol=1e-7, rtol=1e-5
            )


@pytest.mark.parametrize("seed", range(4))
def test_values_are_those_of_the_forward_model(random_points, seed: int) -> None:
    points = random_points(seed, 4 + 5 * seed) * 3.0 + np.array([10.0, -4.0, 2.0])
    for center in (None, inside(points, seed)):
        poses = rest_poses(points, center)
        given = None if center is None else torch.tensor(center)
        normals, probabilities = differentiable_rest(torch.tensor(points), given)
        np.testing.assert_allclose(probabilities.numpy(), poses.probabilities, atol=1e-14)
        np.testing.assert_allclose(normals.numpy(), poses.normals, atol=1e-14)
    rests = evaluate_rests(torch.tensor(points), offset=center - rest_poses(points).center_of_mass)
    np.testing.assert_allclose(rests.center_of_mass.numpy(), center, atol=1e-14)
    values = np.sort(rests.probability_values)
    np.testing.assert_allclose(values, np.sort(poses.probabilities), atol=1e-13)


def test_results_and_gradients_keep_single_precision() -> None:
    """Facets made uneven by rounding are merged, as by `rest_poses`."""
    turned = CUBE * [1.0, 1.1, 1.2] @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    rounded = torch.tensor(turned, dtype=torch.float32, requires_grad=True)
    middle = np.array([0.125, 0.0625, 0.03125])
    center = torch.tensor(middle, dtype=torch.float32, requires_grad=True)
    normals, probabilities = differentiable_rest(rounded, center)
    assert normals.dtype == probabilities.dtype == torch.float32
    expected = rest_poses(rounded.detach().numpy(), center.detach().double().numpy())
    assert len(expected.probabilities) == 6
    np.testing.assert_array_equal(probabilities.detach(), expected.probabilities.astype("f4"))
    np.testing.assert_array_equal(normals.detach(), expected.normals.astype("f4"))
    slopes = torch.autograd.grad(probabilities[0], (rounded, center))
    double = [torch.tensor(part, requires_grad=True) for part in (turned, middle)]
    exact = torch.autograd.grad(differentiable_rest(*double)[1][0], double)
    for slope, wanted in zip(slopes, exact, strict=True):
        assert slope.dtype == torch.float32
        torch.testing.assert_close(slope.double(), wanted, rtol=0, atol=1e-5)
    assert len(evaluate_rests(rounded, center).hull.normals) == 6


def test_saddles_and_maxima_are_those_of_the_forward_model(random_points) -> None:
    points = random_points(4, 11)
    poses, rests = rest_poses(points), evaluate_rests(leaf(points))
    assert rests.facets.tolist() == sorted(poses.facets.tolist())
    state = ClusteredRests.of(rests, poses.normals, poses.probabilities)
    ends = np.array([[line[-1], line[0]] for line in poses.morse.polylines])
    np.testing.assert_allclose(state.saddles.detach(), poses.morse.saddles, atol=1e-14)
    np.testing.assert_allclose(state.maxima.detach().reshape(-1, 2, 3), ends, atol=1e-14)
    for part in (rests.saddles, rests.maxima):
        assert part.requires_grad


def test_probabilities_on_a_table_are_those_of_thrown_dice(random_points) -> None:
    points = random_points(5, 9)
    _, probabilities = differentiable_rest(torch.tensor(points), table="board-game")
    poses = rest_poses(points, "hull")
    expected = throw_probabilities(make_body(points), poses)
    np.testing.assert_allclose(np.sort(probabilities.numpy()), np.sort(expected), atol=1e-12)
    assert np.abs(np.sort(poses.probabilities) - np.sort(expected)).max() > 0.01
    assert (np.diff(probabilities.numpy()) <= 0.0).all()


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


def test_a_tied_body_has_the_mean_of_both_sides() -> None:
    body = off_balance(0.0, corner=False)
    _, probabilities = differentiable_rest(torch.tensor(body.points), torch.tensor(body.center))
    expected = rest_poses(body.points, body.center).probabilities
    np.testing.assert_allclose(probabilities.numpy(), expected, atol=1e-14)
