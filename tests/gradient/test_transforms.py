"""Transforms of `torch.func`, higher derivatives and batches, against autograd and single calls."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from functools import partial

import numpy as np
import pytest
import torch
from common.kernels import compiled_only
from torch import Tensor
from torch.func import grad, hessian, jacfwd, jacrev, jvp, vmap

from dicedesign.geometry.point_groups import point_group
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.differentiable_rest import differentiable_rest, differentiable_rest_batch
from dicedesign.kernels import ops
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


GOOD = torch.tensor(solids.box(1.0, 2.0, 3.0).points)


def assorted_bodies() -> list[Tensor]:
    """Bodies with 4 to 12 points and with points inside, one that balances and a needle."""
    rng = np.random.default_rng(3)
    bodies = [rng.normal(size=(count, 3)) for count in (4, 7, 12, 5, 9)]
    bodies.insert(2, solids.box(1.0, 1.0, 2.0).points)
    bodies.append(bodies[-1] * [1.0, 1.0, 1e3])
    return [torch.tensor(points) for points in bodies]


def rowwise(normals: Tensor, probabilities: Tensor) -> Tensor:
    """A sum with different weights for all numbers; rows of zeros add nothing."""
    weights = torch.arange(1.0, probabilities.shape[-1] + 1.0, dtype=torch.float64)
    turns = normals @ torch.tensor([0.3, -0.7, 0.2]).double()
    return (weights * (probabilities**2 + probabilities * turns)).sum()


def one_by_one(
    bodies: Sequence[Tensor], centers: Tensor | None = None, table: str | None = None
) -> tuple[list[tuple[Tensor, Tensor]], list[Tensor], list[Tensor]]:
    """Normals and probabilities of each body, and gradients of their weighted sums."""
    results, slopes, by_center = [], [], []
    for place, points in enumerate(bodies):
        leaf = points.clone().requires_grad_()
        center = None if centers is None else centers[place].clone().requires_grad_()
        results.append(differentiable_rest(leaf, center, table=table))
        rowwise(*results[-1]).backward()
        slopes.append(leaf.grad)
        by_center.append(torch.zeros(3) if center is None else center.grad)
    return results, slopes, by_center


def assert_rows(mapped: tuple[Tensor, Tensor], alone: Sequence[tuple[Tensor, Tensor]]) -> None:
    """Normals and probabilities of many bodies are those of each, followed by zeros."""
    assert mapped[1].shape == (len(alone), max(len(own) for _, own in alone))
    for row, single in enumerate(alone):
        for many, one in zip(mapped, single, strict=True):
            assert torch.equal(many[row, : len(one)], one)
            assert not many[row, len(one) :].any()


@pytest.mark.parametrize(("given", "table"), [(False, None), (True, None), (True, "board-game")])
def test_a_batch_equals_single_calls(way, given: bool, table: str | None) -> None:
    bodies = assorted_bodies()
    centers = torch.stack([points.mean(0) for points in bodies]) if given else None
    with way():
        singles, slopes, by_center = one_by_one(bodies, centers, table)
        leaves = [points.clone().requires_grad_() for points in bodies]
        middles = None if centers is None else centers.clone().requires_grad_()
        normals, probabilities = differentiable_rest_batch(leaves, middles, table=table)
        rowwise(normals, probabilities).backward()
    assert_rows((normals, probabilities), singles)
    for row, slope in enumerate(slopes):
        atol = 1e-12 * slope.abs().max()
        torch.testing.assert_close(leaves[row].grad, slope, rtol=0, atol=atol)
        if middles is not None:
            torch.testing.assert_close(middles.grad[row], by_center[row], rtol=0, atol=atol)


def test_a_padded_tensor_equals_a_list(way) -> None:
    """Ignored rows can have any content."""
    bodies = assorted_bodies()
    counts = [len(points) for points in bodies]
    padded = torch.full((len(bodies), max(counts) + 1, 3), torch.nan, dtype=torch.float64)
    for row, points in enumerate(bodies):
        padded[row, : len(points)] = points
    padded.requires_grad_()
    with way():
        expected = differentiable_rest_batch(bodies)
        _, slopes, _ = one_by_one(bodies)
        for given in (counts, torch.tensor(counts, dtype=torch.int32)):
            from_padded = differentiable_rest_batch(padded, counts=given)
            for ours, theirs in zip(from_padded, expected, strict=True):
                assert torch.equal(ours, theirs)
        (gradient,) = torch.autograd.grad(rowwise(*from_padded), padded)
    for row, slope in enumerate(slopes):
        atol = 1e-12 * slope.abs().max()
        torch.testing.assert_close(gradient[row, : counts[row]], slope, rtol=0, atol=atol)
        assert not gradient[row, counts[row] :].any()


def test_maps_over_bodies_of_every_kind(way) -> None:
    """Numbers of rests differ, and one body balances."""
    rng = np.random.default_rng(1)
    points = torch.tensor(unit_vectors(rng.normal(size=(4, 8, 3))))
    points[1] = GOOD
    points[3] *= torch.tensor([1.0, 1.0, 4.0])
    centers = points.mean(1)
    with way():
        singles, *slopes = one_by_one(points, centers)
        assert len({len(own) for _, own in singles}) > 2
        assert_rows(vmap(differentiable_rest)(points, centers), singles)
        weigh = grad(lambda *body: rowwise(*differentiable_rest(*body)), argnums=(0, 1))
        for mapped, expected in zip(vmap(weigh)(points, centers), slopes, strict=True):
            torch.testing.assert_close(mapped, torch.stack(expected), rtol=0, atol=1e-13)


@compiled_only
def test_other_threads_run_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another Python thread runs before the kernels are done."""
    turns, done, original, counted = [0], threading.Event(), ops.bodies, []

    def count() -> None:
        while not done.wait(1e-4):
            turns[0] += 1

    def watch(*arguments: object) -> object:
        before = turns[0]
        answer = original(*arguments)  # type: ignore[arg-type]
        counted.append(turns[0] - before)
        return answer

    monkeypatch.setattr(ops, "bodies", watch)
    other, usual = threading.Thread(target=count), sys.getswitchinterval()
    other.start()
    # None gets a turn but where another one waits.
    sys.setswitchinterval(1000.0)
    try:
        differentiable_rest_batch(torch.randn(3000, 30, 3, generator=torch.manual_seed(0)).double())
    finally:
        sys.setswitchinterval(usual)
        done.set()
        other.join()
    assert counted[0] > 0
