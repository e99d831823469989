"""Circles in facets, the barrier, and secants of probabilities: closed forms and differences."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import torch
from common.stones import stone

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.hulls.polygons import inscribed_circle
from dicedesign.geometry.sphere import rotation_between
from dicedesign.gradient.facet_measures import (
    SOFTNESS,
    circle_radii,
    offset_derivatives,
    offset_secants,
    soft_circle_radii,
)
from dicedesign.gradient.probability_model import RESTING, ThrowProbabilities
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.solvers.null_space_descent import BARRIER_DEPTH, barrier_residuals
from dicedesign.optimize.starts.shapes import prism, repulsion

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


BOARD_GAME = ThrowProbabilities.on("board-game")


def half_spaces(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Normals (9, 3) and distances (9,) of a body with three facets at each corner."""
    rng = np.random.default_rng(seed)
    return convex_hull(repulsion(9, seed).points).normals, rng.uniform(0.8, 1.2, size=9)


def evaluate_half_spaces(
    normals: np.ndarray, distances: np.ndarray, center: torch.Tensor | None = None
) -> RestEvaluation:
    return evaluate_rests(torch.tensor(polyhedron_corners(normals, distances)), center)


def of_facets(rests: RestEvaluation, values: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Values (9,) by facet in the list of normals, from values of the rests."""
    numbers = np.argmax(rests.hull.normals[rests.paths.rests] @ normals.T, axis=1)
    by_facet = np.zeros((len(normals), *values.shape[1:]))
    by_facet[numbers] = values
    return by_facet


@pytest.mark.parametrize("model", [RESTING, BOARD_GAME], ids=["set down", "thrown"])
@pytest.mark.parametrize("given", [False, True], ids=["uniform", "given center"])
def test_derivatives_are_differences(given: bool, model: ThrowProbabilities) -> None:
    normals, distances = half_spaces(0)
    center = torch.tensor([0.03, -0.02, 0.01], dtype=torch.float64) if given else None
    step = 1e-6

    def probabilities(moved: np.ndarray) -> np.ndarray:
        rests = evaluate_half_spaces(normals, moved, center)
        return of_facets(rests, model.probabilities(rests), normals)

    differences = np.stack(
        [
            (probabilities(distances + e) - probabilities(distances - e)) / (2 * step)
            for e in step * np.eye(9)
        ],
        axis=1,
    )
    rests = evaluate_half_spaces(normals, distances, center)
    columns = np.argmax(normals @ rests.hull.normals.T, axis=1)
    rows = model.jacobian(rests)
    derivatives = of_facets(rests, offset_derivatives(rests, rows)[:, columns], normals)
    np.testing.assert_allclose(derivatives, differences, atol=2e-7)
    assert np.abs(derivatives).max() > 0.1
    secants = offset_secants(rests, 1e-6, model).detach().numpy()
    np.testing.assert_allclose(secants, offset_derivatives(rests, rows), atol=2e-7)


@pytest.mark.parametrize(("seed", "step"), [(1, 0.005), (2, 0.05)])
def test_secants_are_differences_of_bodies_with_moved_facets(seed: int, step: float) -> None:
    normals, distances = half_spaces(seed)
    rests = evaluate_half_spaces(normals, distances)
    columns = np.argmax(normals @ rests.hull.normals.T, axis=1)
    secants = of_facets(rests, offset_secants(rests, step)[:, columns].numpy(), normals)
    sides = []
    for offset in (step, -step):
        moved = [evaluate_half_spaces(normals, distances + e) for e in offset * np.eye(9)]
        sides.append(
            np.stack([of_facets(one, one.probability_values, normals) for one in moved], axis=1)
        )
    np.testing.assert_allclose(secants, (sides[0] - sides[1]) / (2 * step), atol=1e-9)
