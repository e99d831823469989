"""Hand-derived adjoints against the same functions in torch's own operations, on bodies of every
kind."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
import torch
from common.bodies import blade
from common.kernels import compiled_only, without_kernels
from common.stones import both_ways

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.gradient.rest_probabilities import (
    RestEvaluation,
    centroid_gradient,
    hull_centroid,
)
from dicedesign.optimize.clusters import ClusteredRests, Clusters, cluster
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.energy import Energy, energy_terms
from dicedesign.optimize.starts.shapes import hendecahedron, prism, repulsion
from dicedesign.optimize.terms import EnergyWeights
from tests.reference import solids

REGULARIZERS = {
    "coplanar": 0.3,
    "barycenter": 1.7,
    "neighbor": 0.4,
    "apart": 0.7,
    "hold": 0.5,
    "clear": 0.3,
}
WEIGHTS = EnergyWeights(
    **REGULARIZERS,
    neighbor_radius=0.6,
    apart_distance=1.6,
    hold_margin=0.2,
    clear_margin=0.3,
)


def needle(length: float) -> np.ndarray:
    points = np.random.default_rng(3).normal(size=(14, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points * [1.0, 0.9, length] @ np.linalg.qr(points[:3])[0]


BODIES: dict[str, Callable[[], np.ndarray]] = {
    **{f"random {n}": lambda n=n: np.random.default_rng(n).normal(size=(n, 3)) for n in (4, 40)},
    "long paths": lambda: blade(40, 100).vertices,
    "thin needle": lambda: needle(1000.0),
    "plate": lambda: needle(1e-4),
    "box": lambda: solids.box(1.0, 2.0, 3.0).points,
    "prism": lambda: prism(7, height=1.0, cap=0.3).points * [1.0, 1.1, 1.2],
    "die": lambda: hendecahedron("circus").points,
    "far away": lambda: 1e3 * repulsion(8, 1).points + [1e5, -2e5, 3e5],
}


def copy_without_cache(rests: RestEvaluation) -> RestEvaluation:
    """Copy of an evaluation without computed properties."""
    return RestEvaluation(rests.equilibria, rests.vertices, rests.given_center)


def gradients(value: torch.Tensor, rests: RestEvaluation) -> np.ndarray:
    """(n, 3) or, with a center of its own as the last row, (n + 1, 3)."""
    leaves = [rests.vertices] + ([] if rests.given_center is None else [rests.given_center])
    slopes = torch.autograd.grad(value, leaves, retain_graph=True, materialize_grads=True)
    return np.concatenate([part.numpy().reshape(-1, 3) for part in slopes])


def assert_same(
    actual: np.ndarray, expected: np.ndarray, tolerance: float = 1e-9, least: float = 0.0
) -> None:
    """Compare arrays, relative to the largest entry or a least size."""
    size = max(float(np.abs(expected).max()), least, np.finfo(np.float64).tiny)
    assert float(np.abs(actual - expected).max()) <= tolerance * size


@compiled_only
@pytest.mark.parametrize("name", BODIES)
def test_probabilities_depths_normals_and_the_centroid(name: str) -> None:
    points, rng = BODIES[name](), np.random.default_rng(0)
    facets = np.concatenate([np.arange(len(convex_hull(points).normals))[::-1], [0, 1, 0]])

    def tensors(rests: RestEvaluation) -> list[torch.Tensor]:
        return [rests.probabilities, rests.facet_depths, rests.facet_normals(facets)]

    for rests in both_ways(points):
        twin = copy_without_cache(rests)
        with without_kernels():
            expected = tensors(twin)
        for ours, theirs in zip(tensors(rests), expected, strict=True):
            atol = 1e-12 if ours.dim() == 1 else 1e-9
            np.testing.assert_allclose(ours.detach(), theirs.detach(), rtol=0, atol=atol)
            weights = torch.tensor(rng.normal(size=ours.shape))
            slopes = gradients((ours * weights).sum(), rests)
            assert_same(slopes, gradients((theirs * weights).sum(), twin), 1e-8)
        jacobian = rests.jacobian
        assert jacobian.shape == (len(rests.paths.rests), rests.vertices.numel())
        for place in range(0, len(jacobian), max(1, len(jacobian) // 5)):
            row = gradients(rests.probabilities[place], rests)[: len(rests.vertices)]
            assert_same(jacobian[place].reshape(-1, 3), row, 1e-10)

    hull, vertices, along = rests.hull, rests.vertices, np.array([0.3, -0.8, 0.5])
    centroid, slope = hull_centroid(vertices, hull), centroid_gradient(hull, along)
    by_torch = torch.autograd.grad(centroid @ torch.tensor(along), vertices)[0].numpy()
    np.testing.assert_array_equal(by_torch, slope)
    with without_kernels():
        expected_centroid = hull_centroid(vertices, hull)
        assert_same(slope, centroid_gradient(hull, along))
    atol = 1e-12 * np.ptp(hull.vertices, axis=0).max()
    np.testing.assert_allclose(centroid.detach(), expected_centroid.detach(), rtol=1e-15, atol=atol)


def clusters_of(rests: RestEvaluation, outcomes: int) -> Clusters:
    rng = np.random.default_rng(outcomes)
    directions = rng.normal(size=(outcomes, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return cluster(rests.hull.normals[rests.paths.rests], directions)


def gradient_of(term: torch.Tensor, rests: RestEvaluation) -> np.ndarray:
    """Gradient (n, 3) of a term in the vertices; 0 if it does not depend on them."""
    count = len(rests.vertices)
    return gradients(term, rests)[:count] if term.requires_grad else np.zeros((count, 3))


@compiled_only
@pytest.mark.parametrize("name", BODIES)
def test_energies(name: str) -> None:
    """Few outcomes make clusters of several rests, many make empty clusters."""
    for rests, outcomes in product(both_ways(BODIES[name]()), (1, 3, 12)):
        target = np.random.default_rng(0).dirichlet(np.ones(outcomes))
        clusters, twin = clusters_of(rests, outcomes), copy_without_cache(rests)
        least = 1e-3 / np.ptp(rests.hull.vertices, axis=0).max()
        with without_kernels():
            state = ClusteredRests(twin, clusters, target)
            expected, plain = energy_terms(state, WEIGHTS), Energy(state, WEIGHTS)
            slopes = {term: gradient_of(tensor, twin) for term, tensor in expected.items()}
            assert_same(plain.gradient, np.sum(list(slopes.values()), axis=0), 1e-13)
        state = ClusteredRests(rests, clusters, target)
        whole = Energy(state, WEIGHTS)
        values = {term: tensor.item() for term, tensor in expected.items()}
        assert plain.terms == values
        assert whole.terms == pytest.approx(values, rel=1e-10, abs=1e-12)
        assert_same(whole.gradient, plain.gradient, 1e-8)
        for kept in REGULARIZERS:
            others = dict.fromkeys(set(REGULARIZERS) - {kept}, 0.0)
            alone = Energy(state, WEIGHTS.replace(**others))
            assert alone.terms == {term: whole.terms[term] for term in ("dice", kept)}
            assert_same(alone.gradient, slopes["dice"] + slopes[kept], 1e-8, least)


def test_corners_of_half_spaces_pull_gradients_back(random_points, way) -> None:
    """Each row as by the formula in torch, with a half-space that cuts nothing."""
    points = random_points(6, 10)
    coordinates, values = FacetCoordinates.of(points, points.mean(axis=0))
    count = len(values) // 4
    parameters = np.concatenate([values[: 3 * count], [3.0, 0, 0], values[3 * count :], [3.0]])
    shape = coordinates.shape(parameters)
    leaf = torch.tensor(parameters, requires_grad=True)
    by_formula = coordinates.points(leaf)
    rows = np.random.default_rng(0).normal(size=(4, *shape.points.shape))
    with way():
        pulled_back = shape.pull_back(rows)
        assert shape.pull_back(rows[:0]).shape == (0, len(parameters))
    assert pulled_back.shape == (4, len(parameters))
    for row, slope in zip(rows, pulled_back, strict=True):
        expected = torch.autograd.grad(
            (by_formula * torch.tensor(row)).sum(), leaf, retain_graph=True
        )
        assert_same(slope, expected[0].numpy(), 1e-12)
    idle = [3 * count, 3 * count + 1, 3 * count + 2, len(parameters) - 1]
    assert (pulled_back[:, idle] == 0.0).all()
