"""Circles in facets and the barrier: closed forms, the linear program, finite differences."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import torch
from common.stones import stone

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.polygons import inscribed_circle
from dicedesign.geometry.sphere import rotation_between
from dicedesign.gradient.facet_measures import SOFTNESS, circle_radii, soft_circle_radii
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.solvers.null_space_descent import BARRIER_DEPTH, barrier_residuals
from dicedesign.optimize.starts.shapes import prism

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))
AROUND = np.linspace(0.0, 2.0 * np.pi, 41)[:-1] + 0.05 * np.sin(np.arange(40))
DRUM = np.concatenate(
    [np.column_stack([np.cos(AROUND), np.sin(AROUND), np.full(40, z)]) for z in (-0.3, 0.4)]
)
"""Bases of 40 edges."""
UP = np.array([0.0, 0.0, 1.0])


def evaluate(points: np.ndarray) -> RestEvaluation:
    return evaluate_rests(torch.tensor(points, dtype=torch.float64))


def all_facets(rests: RestEvaluation) -> np.ndarray:
    return np.arange(len(rests.hull.normals))


def round_stone(seed: int, facets: int = 9) -> np.ndarray:
    return stone(seed, facets, noise=0.15, least=0.9, longest=1.0)


def test_radii_are_those_of_the_linear_program() -> None:
    bodies = [CUBE, CUBE * [1.0, 2.0, 5.0], prism(12).points, round_stone(0, 40), DRUM]
    bodies += [np.random.default_rng(seed).normal(size=(20, 3)) for seed in range(3)]
    for points in [*bodies, *(round_stone(seed) for seed in range(4))]:
        rests = evaluate(points)
        hull, facets = rests.hull, all_facets(rests)
        expected = []
        for facet in facets:
            upright = rotation_between(hull.normals[facet], UP)
            expected.append(inscribed_circle((hull.polygon(facet) @ upright.T)[:, :2])[1])
        radii = circle_radii(rests, facets).numpy() * hull.diameter
        np.testing.assert_allclose(radii, expected, rtol=1e-9)


@pytest.mark.parametrize("measure", ["largest", "soft", "barrier"])
@pytest.mark.parametrize("seed", range(2))
def test_gradients_are_differences(measure: str, seed: int) -> None:
    points = round_stone(seed)
    coordinates, parameters = FacetCoordinates.of(points, convex_hull(points).centroid)

    def values(moved: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
        leaf = torch.tensor(moved, requires_grad=True)
        rests = evaluate_rests(coordinates.points(leaf))
        if measure == "barrier":
            return leaf, barrier_residuals(rests)
        radii = circle_radii if measure == "largest" else soft_circle_radii
        return leaf, radii(rests, all_facets(rests))

    along = np.random.default_rng(seed).normal(size=len(parameters))
    step = 1e-6
    above, below = (values(parameters + sign * step * along)[1].detach() for sign in (1, -1))
    leaf, center_value = values(parameters)
    for value, difference in zip(center_value, (above - below) / (2 * step), strict=True):
        (gradient,) = torch.autograd.grad(value, leaf, retain_graph=True)
        assert gradient.numpy() @ along == pytest.approx(difference.item(), rel=1e-5, abs=1e-7)


def test_the_barrier_of_a_box() -> None:
    rests = evaluate(CUBE * [1.0, 1.0, 0.3])
    size = np.sqrt(2.09)
    for normal, residual in zip(rests.hull.normals, barrier_residuals(rests), strict=True):
        if abs(normal[2]) > 0.9:
            assert residual.item() == pytest.approx(BARRIER_DEPTH * size)
        else:
            # Two edges at 0.3 of length 2, and two at 1 of length 0.6.
            mean = (2 * 0.3**-SOFTNESS + 0.6) / 2.6
            assert residual.item() == pytest.approx(BARRIER_DEPTH * size * mean ** (1 / SOFTNESS))
