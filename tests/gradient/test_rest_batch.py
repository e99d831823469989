"""Batches and maps of bodies against single calls."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence

import numpy as np
import pytest
import torch
from common.kernels import compiled_only
from torch import Tensor
from torch.func import grad, vmap

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.differentiable_rest import differentiable_rest, differentiable_rest_batch
from dicedesign.kernels import ops
from tests.reference import solids

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
