"""The elastic energy against torch's automatic differentiation, finite differences and symmetry."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from common.bumpy import bent_capsule, bumpy_sphere
from torch import Tensor

from dicedesign.concave.elastic_energy import (
    ElasticEnergy,
    bending_energy,
    hinge_angles,
    membrane_energy,
    positive_semidefinite,
)
from dicedesign.errors import InputError
from dicedesign.geometry.sphere import rotation_between
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats


def membrane_of(corners: Tensor, rest: Tensor) -> Tensor:
    """The mean of both ratios of the principal stretches, less 1, from the map's own Jacobian."""
    first, second = rest[1] - rest[0], rest[2] - rest[0]
    along = first / first.norm()
    across = second - (second @ along) * along
    zero = torch.zeros((), dtype=torch.float64)
    flat = torch.stack(
        [
            torch.stack([first.norm(), zero]),
            torch.stack([second @ along, across.norm()]),
        ]
    )
    jacobian = torch.linalg.solve(
        flat, torch.stack([corners[1] - corners[0], corners[2] - corners[0]])
    )
    metric = jacobian @ jacobian.T
    return 0.5 * metric.trace() / metric.det().sqrt() - 1.0


def angle_of(corners: Tensor) -> Tensor:
    start, end, left, right = corners
    first = torch.linalg.cross(end - start, left - start)
    second = torch.linalg.cross(start - end, right - end)
    edge = (end - start) / (end - start).norm()
    return torch.atan2(torch.linalg.cross(first, second) @ edge, first @ second)


def stiffness_of(rest: Floats) -> Floats:
    """The cotangent stiffness of each triangle, from its angles."""
    result = np.zeros((len(rest), 3, 3))
    for matrix, corners in zip(result, rest, strict=True):
        for apex in range(3):
            i, j = (apex + 1) % 3, (apex + 2) % 3
            u, v = corners[i] - corners[apex], corners[j] - corners[apex]
            cotangent = u @ v / np.linalg.norm(np.cross(u, v))
            matrix[[i, j], [j, i]] -= 0.5 * cotangent
            matrix[[i, j], [i, j]] += 0.5 * cotangent
    return result


def test_the_membrane_is_that_of_the_principal_stretches() -> None:
    rng = np.random.default_rng(1)
    rest, corners = rng.normal(size=(2, 6, 3, 3))
    weights = rng.uniform(0.5, 2.0, size=6)
    found = membrane_energy(corners, weights[:, None, None] * stiffness_of(rest), weights)
    assert found.hessians is not None
    for k in range(6):
        at = torch.tensor(corners[k])

        def energy(points: Tensor, k: int = k) -> Tensor:
            return weights[k] * membrane_of(points.reshape(3, 3), torch.tensor(rest[k]))

        assert found.values[k] == pytest.approx(float(energy(at)), rel=1e-9)
        gradient, hessian = derivatives(energy, at)
        np.testing.assert_allclose(found.gradients[k], gradient.reshape(3, 3), rtol=1e-7)
        np.testing.assert_allclose(found.hessians[k], hessian, rtol=1e-6, atol=1e-9)


def test_bending_is_that_of_the_angles() -> None:
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(6, 4, 3))
    rest, weights = rng.normal(size=6), rng.uniform(0.5, 2.0, size=6)
    found = bending_energy(corners, rest, weights)
    assert found.hessians is not None
    for k in range(6):
        at = torch.tensor(corners[k])

        def energy(points: Tensor, k: int = k) -> Tensor:
            change = angle_of(points.reshape(4, 3)) - rest[k]
            turn = 2.0 * np.pi
            change = change - turn * torch.round(change.detach() / turn)
            return weights[k] * change**2

        assert found.values[k] == pytest.approx(float(energy(at)), rel=1e-9)
        gradient, hessian = derivatives(energy, at)
        np.testing.assert_allclose(found.gradients[k], gradient.reshape(4, 3), rtol=1e-7)
        np.testing.assert_allclose(found.hessians[k], hessian, rtol=1e-6, atol=1e-8)


def derivatives(energy: Callable[[Tensor], Tensor], at: Tensor) -> tuple[Floats, Floats]:
    flat = at.reshape(-1)
    gradient = torch.autograd.functional.jacobian(energy, flat)
    hessian = torch.autograd.functional.hessian(energy, flat)
    return gradient.numpy(), hessian.numpy()


def test_ridges_have_positive_angles() -> None:
    roof = np.array([[[0.0, 0, 0], [1, 0, 0], [0.5, 1, -1], [0.5, -1, -1]]])
    assert hinge_angles(roof) == pytest.approx(np.pi / 2)
    assert hinge_angles(roof * [1, 1, -1]) == pytest.approx(-np.pi / 2)


def test_the_nearest_semidefinite_matrices() -> None:
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(20, 4, 3))
    hessians = bending_energy(corners, rng.normal(size=20), np.ones(20)).hessians
    assert hessians is not None
    projected = positive_semidefinite(hessians)
    values, vectors = np.linalg.eigh(hessians)
    assert values.min() < -0.1
    expected = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.swapaxes(1, 2)
    np.testing.assert_allclose(projected, expected, atol=1e-9 * np.abs(hessians).max())


@pytest.mark.parametrize("surface", [bumpy_sphere(), bent_capsule()])
def test_nothing_pulls_at_the_reference_wherever_it_is(surface: Surface) -> None:
    energy = ElasticEnergy.of(surface, 1.0, 0.02)
    turn = rotation_between(np.array([1.0, 0.3, 0.2]), np.array([-0.2, 0.8, 0.1]))
    for points in (surface.points, 3.0 * surface.points @ turn.T + 7.0):
        assert sum(energy.terms(points)) == pytest.approx(0.0, abs=1e-12)
        assert np.abs(energy.gradient(points)).max() < 1e-11


def test_the_energy_does_not_change_when_the_surface_is_turned_moved_or_scaled() -> None:
    surface = bumpy_sphere(1)
    energy = ElasticEnergy.of(surface, 1.0, 0.02)
    points = surface.points + 0.05 * np.random.default_rng(4).normal(size=surface.points.shape)
    turn = rotation_between(np.array([0.1, 1.0, 0.0]), np.array([0.0, 0.2, -1.0]))
    there = energy.terms(0.5 * points @ turn.T - 3.0)
    assert min(there) > 1e-3
    assert there == pytest.approx(energy.terms(points), rel=1e-10)


def test_gradient_and_hessian_of_the_whole_surface() -> None:
    surface = bumpy_sphere(1)
    rng = np.random.default_rng(5)
    energy = ElasticEnergy.of(surface, 1.0, 0.02)
    points = surface.points + 0.02 * rng.normal(size=surface.points.shape)
    way = rng.normal(size=points.shape)
    step = 1e-6
    after, before = (sum(energy.terms(points + s * way)) for s in (step, -step))
    gradient, hessian = energy.model(points)
    np.testing.assert_allclose(gradient, energy.gradient(points), rtol=1e-12, atol=1e-14)
    assert (gradient * way).sum() == pytest.approx((after - before) / (2.0 * step), rel=1e-6)
    dense = hessian.toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-12 * np.abs(dense).max())
    assert np.linalg.eigvalsh(dense).min() > -1e-12 * np.abs(dense).max()
    # At the reference nothing has to be projected away.
    _, hessian = energy.model(surface.points)
    pulls = [energy.gradient(surface.points + s * way) for s in (step, -step)]
    expected = ((pulls[0] - pulls[1]) / (2.0 * step)).ravel()
    np.testing.assert_allclose(hessian @ way.ravel(), expected, atol=1e-6 * np.abs(expected).max())


def test_a_flat_triangle_has_infinite_energy() -> None:
    surface = bumpy_sphere(1)
    energy = ElasticEnergy.of(surface, 1.0, 0.02)
    points = surface.points.copy()
    a, b, c = surface.triangles[0]
    points[c] = 0.5 * (points[a] + points[b])
    assert sum(energy.terms(points)) > 1e3
    points[c] = points[a]
    assert energy.terms(points)[0] == np.inf


def test_a_reference_with_a_flat_triangle_is_refused() -> None:
    surface = bumpy_sphere(1)
    points = surface.points.copy()
    points[surface.triangles[3, 0]] = points[surface.triangles[3, 1]]
    with pytest.raises(InputError, match="expected triangles with an area"):
        ElasticEnergy.of(Surface(points, surface.triangles), 1.0, 0.02)
