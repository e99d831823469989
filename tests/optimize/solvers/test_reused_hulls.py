"""Designs that keep a hull's connectivity take the very same steps as those that do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from common.kernels import compiled_only

from dicedesign.geometry.hulls import hull as hulls
from dicedesign.geometry.hulls.hull import HullMemory, convex_hull
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.options import PaperOptions, SobolevOptions
from dicedesign.optimize.solvers.candidate import DesignResult
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.optimize.starts.shapes import prism, repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import Target, binomial, fair


def ellipsoid(count: int) -> Start:
    """Points on a spiral, and three directions around."""
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    angle = np.pi * (1.0 + 5.0**0.5) * np.arange(count)
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.sqrt(1.0 - height**2)[:, None]
    points = np.column_stack([around, height]) * [1.3, 1.0, 0.8]
    thirds = 2.0 * np.pi * np.arange(3) / 3.0
    return Start(points, np.stack([np.cos(thirds), np.sin(thirds), np.zeros(3)], axis=1))


FEW = PaperOptions(step="line_search", steps=25, finish="none")
DESIGNS: dict[str, tuple[Start, Target, PaperOptions]] = {
    "binomial 4": (prism(5), binomial(4), replace(FEW, steps=8)),
    "momentum": (repulsion(6, 1), fair(6), PaperOptions(steps=25, finish="none")),
    "mesh": (ellipsoid(60), fair(3), replace(FEW, sobolev=SobolevOptions(), steps=5)),
}


def designed(name: str) -> DesignResult:
    start, target, options = DESIGNS[name]
    return descend_as_paper(start, target.probabilities, options)


@compiled_only
@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_a_descent_is_the_same_without_reuse(monkeypatch, name: str) -> None:
    result = designed(name)
    monkeypatch.setattr(hulls, "same_connectivity", lambda hull, points: None)
    plain = designed(name)
    assert plain.hulls_reused == 0
    assert result.hulls_built + result.hulls_reused == plain.hulls_built
    assert result.hulls_reused > 0
    assert len(result.history) > 3
    for ours, theirs in zip(result.history, plain.history, strict=True):
        assert (ours.energy, ours.terms, ours.error) == (theirs.energy, theirs.terms, theirs.error)
    assert (result.status, result.evaluations) == (plain.status, plain.evaluations)
    for part in ("vertices", "source", "facet_start", "tail", "twin"):
        np.testing.assert_array_equal(getattr(result.hull, part), getattr(plain.hull, part))


def test_values_and_gradients_with_a_memory_are_those_without() -> None:
    start = repulsion(8, 3)
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    polars, shapes = HullMemory(), HullMemory()
    rng = np.random.default_rng(0)
    for _ in range(10):
        parameters = parameters + 1e-4 * rng.normal(size=parameters.shape)
        results = []
        for polar_of, shape_of in ((polars.hull, shapes.hull), (convex_hull, convex_hull)):
            leaf = torch.tensor(parameters, requires_grad=True)
            rests = evaluate_rests(coordinates.points(leaf, polar_of), None, shape_of)
            (gradient,) = torch.autograd.grad((rests.probabilities**3).sum(), leaf)
            results.append((rests.probabilities.detach().numpy(), gradient.numpy()))
        for ours, theirs in zip(*results, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    assert polars.reused > 5
    assert shapes.reused > 5
