"""Probabilities as functions of the places of facets, against bodies with moved facets."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.gradient.facet_measures import offset_derivatives, offset_secants
from dicedesign.gradient.probability_model import RESTING, ThrowProbabilities
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.starts.shapes import repulsion

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
