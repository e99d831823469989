"""Transforms of `torch.func` and higher derivatives, against plain autograd, differences, each
other and one body at a time."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.func import grad, hessian, jacfwd, jacrev, jvp, vmap

from dicedesign.geometry.point_groups import point_group
from dicedesign.gradient.differentiable_rest import differentiable_rest, differentiable_rest_batch
from dicedesign.optimize.coordinates import FacetCoordinates, SymmetricCoordinates
from tests.reference import solids

# Torch itself warns where it is first asked for tangents.
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated")


def die(seed: int, count: int = 6) -> Tensor:
    """Points near a sphere."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return torch.tensor(points * rng.uniform(0.9, 1.1, size=(count, 1)))


def probabilities(points: Tensor, center: Tensor | None = None, table: str | None = None) -> Tensor:
    return differentiable_rest(points, center, table=table)[1]


def energy(points: Tensor, center: Tensor | None = None, table: str | None = None) -> Tensor:
    """Function of normals and probabilities that does not depend on rows of zeros."""
    normals, probabilities = differentiable_rest(points, center, table=table)
    return (probabilities**2).sum() + (normals[:, 0] * probabilities).sum()


def by_autograd(points: Tensor, *center: Tensor, **options: str) -> tuple[Tensor, ...]:
    leaves = [tensor.clone().requires_grad_() for tensor in (points, *center)]
    return torch.autograd.grad(energy(*leaves, **options), leaves)


@pytest.mark.parametrize("table", [None, "board-game"])
def test_gradients_are_those_of_autograd_and_tangents_are_differences(
    way, table: str | None
) -> None:
    points, along, step = die(1), die(3), 1e-6
    center, aside = points.mean(0), along.mean(0)
    function = partial(probabilities, table=table)
    with way():
        expected = by_autograd(points, center, table=table)
        gradients = grad(partial(energy, table=table), argnums=(0, 1))(points, center)
        torch.testing.assert_close(gradients, expected, rtol=0, atol=1e-14)
        value, tangent = jvp(function, (points, center), (along, aside))
        ahead, behind = (function(points + t * along, center + t * aside) for t in (step, -step))
    torch.testing.assert_close(value, function(points, center), rtol=0, atol=1e-12)
    torch.testing.assert_close(tangent, (ahead - behind) / (2.0 * step), rtol=0, atol=1e-8)


def test_first_and_second_derivatives_of_a_uniform_solid(way) -> None:
    points, along, step = die(6), die(7), 1e-6
    with way():
        backward, forward = jacrev(probabilities)(points), jacfwd(probabilities)(points)
        _, tangent = jvp(probabilities, (points,), (along,))
        rows = torch.autograd.functional.jacobian(probabilities, points)
        second = hessian(energy)(points)
        ahead, behind = (by_autograd(points + t * along)[0] for t in (step, -step))
    torch.testing.assert_close(backward, rows, rtol=0, atol=1e-13)
    torch.testing.assert_close(forward, rows, rtol=0, atol=1e-13)
    torch.testing.assert_close(tangent, (rows * along).sum((1, 2)), rtol=0, atol=1e-13)
    along_once = (second * along).sum((2, 3))
    torch.testing.assert_close(along_once, (ahead - behind) / (2.0 * step), rtol=0, atol=1e-7)
    torch.testing.assert_close(second, second.permute(2, 3, 0, 1), rtol=0, atol=1e-10)


def test_maps_and_derivatives_in_any_order(way) -> None:
    points, along = torch.stack([die(1), die(2)]), torch.stack([die(3), die(4)])
    with way():
        expected = torch.stack([by_autograd(body)[0] for body in points])
        outside = grad(lambda bodies: vmap(energy)(bodies).sum())(points)
        torch.testing.assert_close(outside, expected, rtol=0, atol=1e-14)
        twice = vmap(vmap(grad(energy)))(points[None].expand(2, *points.shape))
        torch.testing.assert_close(twice[1], expected, rtol=0, atol=1e-14)
        jacobians = vmap(jacrev(probabilities))(points)
        tangents = vmap(lambda body, moved: jvp(probabilities, (body,), (moved,))[1])(points, along)
        by_rows = (jacobians * along[:, None]).sum((2, 3))
        torch.testing.assert_close(tangents, by_rows, rtol=0, atol=1e-12)
        of_slopes = grad(lambda body: (grad(energy)(body) ** 2).sum())
        second = vmap(of_slopes)(points)
        torch.testing.assert_close(second[1], of_slopes(points[1]), rtol=0, atol=1e-11)


def make_coordinates(name: str) -> tuple[FacetCoordinates | SymmetricCoordinates, Tensor]:
    if name != "facets":
        box = solids.box(1.0, 1.0, 1.3).points
        coordinates, numbers = SymmetricCoordinates.of(box, np.zeros(3), point_group(name))
        return coordinates, torch.tensor(numbers) + 0.01 * torch.arange(len(numbers))
    points = die(2, 9).numpy()
    facets, numbers = FacetCoordinates.of(points, points.mean(0))
    # No more than three planes meet anywhere.
    moved = 0.03 * torch.randn(len(numbers), generator=torch.manual_seed(1))
    return facets, torch.tensor(numbers) + moved


@pytest.mark.filterwarnings("ignore")
def test_compiled_code_calls_the_functions_as_they_are() -> None:
    """In a program that compiles, with breaks between its graphs."""
    points = die(5, 14)

    def loss(vertices: Tensor) -> Tensor:
        moved = 1.5 * vertices
        many = differentiable_rest_batch(torch.stack([moved, 2.0 * moved]))[1]
        return energy(moved) + many.amax()

    slopes = []
    for function in (loss, torch.compile(loss, backend="eager")):
        vertices = points.clone().requires_grad_()
        value = function(vertices)
        value.backward()
        slopes.append((value.detach(), vertices.grad))
    torch.testing.assert_close(slopes[1], slopes[0])


@pytest.mark.parametrize("name", ["facets", "D2d"])
def test_points_are_differentiable_in_parameters(name: str) -> None:
    coordinates, parameters = make_coordinates(name)
    points = coordinates.points(parameters)
    by_shape = coordinates.shape(parameters.numpy()).points
    np.testing.assert_allclose(points, by_shape, rtol=0, atol=1e-14)
    leaf = parameters.clone().requires_grad_()
    assert torch.autograd.gradcheck(coordinates.points, leaf, check_forward_ad=True)
    weights = torch.linspace(-1.0, 1.0, points.numel()).double().reshape(points.shape)

    def weigh(values: Tensor) -> Tensor:
        return (weights * coordinates.points(values) ** 2).sum()

    assert torch.autograd.gradgradcheck(weigh, leaf, atol=1e-5)

    center = torch.tensor(points.numpy().mean(0))

    def through(values: Tensor) -> Tensor:
        return energy(coordinates.points(values), center)

    (expected,) = torch.autograd.grad(through(leaf), leaf)
    torch.testing.assert_close(grad(through)(parameters), expected, rtol=0, atol=1e-13)
    many = parameters + 0.03 * torch.randn(3, len(parameters), generator=torch.manual_seed(0))
    alone = torch.stack([grad(through)(row) for row in many])
    torch.testing.assert_close(vmap(grad(through))(many), alone, rtol=0, atol=1e-13)
