"""Energy terms against loops written from the equations, and edge cases."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull as QhullHull

from dicedesign import rest_poses
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.clusters import ClusteredRests, Clusters, cluster
from dicedesign.optimize.energy import Energy, energy_terms
from dicedesign.optimize.starts.shapes import repulsion
from dicedesign.optimize.terms import TERMS, EnergyWeights

REGULARIZERS = ("coplanar", "barycenter", "neighbor", "apart", "hold", "clear")
ROUND = (1.0, 0.9, 1.15)


def term(name: str, rests: RestEvaluation, clusters: Clusters, **options: float) -> torch.Tensor:
    """Value of a term without its weight."""
    state = ClusteredRests(rests, clusters, np.full(len(clusters.directions), 0.1))
    return TERMS[name].evaluate(state, EnergyWeights(**options)).detach()


def case(points: np.ndarray, outcomes: int, seed: int = 0) -> tuple[RestEvaluation, Clusters]:
    """Rests of points, and clusters around random directions of which none is empty."""
    rests = evaluate_rests(torch.tensor(points, requires_grad=True))
    normals = rests.hull.normals[rests.paths.rests]
    rng = np.random.default_rng(seed)
    for _ in range(1000):
        clusters = cluster(normals, unit_vectors(rng.normal(size=(outcomes, 3))))
        if clusters.empty == 0:
            return rests, clusters
    raise AssertionError("no directions without an empty cluster")


@pytest.fixture(params=[(3, 16, 3), (4, 20, 2), (7, 8, 3)])
def clustered(request, random_points):
    seed, count, outcomes = request.param
    rests, clusters = case(random_points(seed, count, ROUND), outcomes, seed)
    return rests, clusters


def test_equations_12_and_13_sum_over_clusters_and_their_ordered_pairs(clustered) -> None:
    rests, clusters = clustered
    normals, p = rests.rest_normals.detach().numpy(), rests.probability_values
    q = np.arange(1.0, len(clusters.directions) + 1.0)
    q /= q.sum()
    dice = coplanar = 0.0
    for i, wanted in enumerate(q):
        members = np.flatnonzero(clusters.of_rest == i)
        dice += (sum(p[member] for member in members) - wanted) ** 2
        for k, other in product(members, members):
            coplanar += np.linalg.norm(normals[k] - normals[other]) ** 2
    value = TERMS["dice"].evaluate(ClusteredRests(rests, clusters, q), EnergyWeights())
    assert float(value.detach()) == pytest.approx(dice, rel=1e-13)
    assert float(term("coplanar", rests, clusters)) == pytest.approx(coplanar, rel=1e-12)


def test_equation_14_measures_from_the_mean_of_border_maxima(clustered) -> None:
    rests, clusters = clustered
    poses = rest_poses(rests.hull.vertices)
    outcome = cluster(poses.normals, clusters.directions).of_rest
    expected = 0.0
    for i in range(len(clusters.directions)):
        peaks: list[np.ndarray] = []
        for line, basins in zip(poses.morse.polylines, poses.morse.saddle_basins, strict=True):
            sides = outcome[basins]
            if i in sides and sides[0] != sides[1]:
                for end in (line[0], line[-1]):
                    if not any(np.linalg.norm(end - peak) < 1e-9 for peak in peaks):
                        peaks.append(end)
        barycenter = unit_vectors(np.sum(peaks, axis=0))
        for normal in poses.normals[outcome == i]:
            expected += np.linalg.norm(normal - barycenter) ** 2
    assert float(term("barycenter", rests, clusters)) == pytest.approx(expected, rel=1e-11)


def test_equation_15_sums_over_all_facets_nearby(clustered) -> None:
    rests, clusters = clustered
    normals = QhullHull(rests.hull.vertices).equations[:, :3]
    for radius in (0.2, 0.5, 2.0):
        distances = np.linalg.norm(clusters.directions[:, None] - normals, axis=2)
        near = distances < radius
        expected = (distances[near] ** 2).sum() + radius**2 * (~near.any(axis=1)).sum()
        value = term("neighbor", rests, clusters, neighbor_radius=radius)
        assert float(value) == pytest.approx(expected, rel=1e-12), radius


def test_a_face_without_a_rest_is_borne_by_the_nearest_and_least_unstable_facet() -> None:
    """By the sum of the cosine and the depth, which both are at most 1."""
    choices = set()
    for seed in range(30):
        rng = np.random.default_rng(seed)
        rests = evaluate_rests(torch.tensor(rng.normal(size=(16, 3)) * [0.5, 1.0, 2.0]))
        normals, facets = rests.hull.normals, rests.paths.rests
        unstable = np.setdiff1d(np.arange(len(normals)), facets)
        lost = unit_vectors(normals[rng.choice(unstable)] + 0.3 * rng.normal(size=3))
        directions = np.array([*normals[facets], lost])
        clusters = cluster(normals[facets], directions)
        state = ClusteredRests(rests, clusters, np.full(len(directions), 0.1))
        assert set(facets) <= set(state.bearing.tolist())
        near = [k for k in unstable if np.argmax(directions @ normals[k]) == len(facets)]
        # Feet outside of facets have depths below 0.
        assert max(rests.depths[near], default=-1.0) < 0.0
        worth = {k: normals[k] @ lost + max(rests.depths[k], -1.0) for k in near}
        best = max(near, key=worth.__getitem__, default=None)
        assert set(state.bearing.tolist()) - set(facets) == ({best} if near else set())
        choices.add(best == max(near, key=lambda k: normals[k] @ lost, default=None))
    assert choices == {True, False}


def test_hold_and_clear_charge_the_deepest_rest_and_all_other_facets(clustered) -> None:
    rests, clusters = clustered
    depths, facets = rests.facet_depths.detach().numpy(), rests.paths.rests
    bearing = {
        max(facets[clusters.of_rest == i], key=depths.__getitem__)
        for i in range(len(clusters.directions))
    }
    others = set(range(len(depths))) - bearing
    for margin in (0.05, 0.3, 1.0):
        hold = sum(max(0.0, 1.0 - depths[facet] / margin) ** 2 for facet in bearing)
        clear = sum(max(0.0, 1.0 + depths[facet] / margin) ** 2 for facet in others)
        held = term("hold", rests, clusters, hold_margin=margin)
        cleared = term("clear", rests, clusters, clear_margin=margin)
        assert [float(held), float(cleared)] == pytest.approx([hold, clear], rel=1e-11)


def test_apart_energy_charges_pairs_of_outcomes_that_are_near(clustered) -> None:
    rests, clusters = clustered
    normals, k = rests.rest_normals.detach().numpy(), len(clusters.directions)
    means = [unit_vectors(normals[clusters.of_rest == i].sum(axis=0)) for i in range(k)]
    for distance in (0.4, 1.2, 2.0):
        expected = 0.0
        for i, j in combinations(range(k), 2):
            x = np.linalg.norm(means[i] - means[j]) ** 2 / distance**2
            expected += -((1.0 - x) ** 2) * np.log(x) if x < 1.0 else 0.0
        value = term("apart", rests, clusters, apart_distance=distance)
        assert float(value) == pytest.approx(expected, rel=1e-11, abs=1e-14), distance


def test_outcomes_in_one_place_have_a_finite_cost() -> None:
    """An outcome without a rest has the direction of another outcome."""
    rests = evaluate_rests(torch.tensor(repulsion(4, 0).points, requires_grad=True))
    normals = rests.hull.normals[rests.paths.rests]
    clusters = cluster(normals, np.concatenate([normals, normals[:1]]))
    state, weights = ClusteredRests(rests, clusters, np.full(5, 0.2)), EnergyWeights(apart=1.0)
    assert 10.0 < float(energy_terms(state, weights)["apart"].detach()) < 20.0
    assert np.isfinite(Energy(state, weights).gradient).all()


# Torch itself warns when it is first asked for tangents.
@pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated")
@pytest.mark.parametrize("name", ["dice", *REGULARIZERS])
def test_gradcheck_of_every_term(random_points, name: str) -> None:
    points = random_points(1, 10, ROUND)
    _, clusters = case(points, 3, 1)
    weights = {**dict.fromkeys(REGULARIZERS, 0.0), **({} if name == "dice" else {name: 0.7})}
    options = EnergyWeights(
        neighbor_radius=0.9,
        apart_distance=2.0,
        hold_margin=1.0,
        clear_margin=0.4,
        **weights,
    )

    def value(vertices: torch.Tensor) -> torch.Tensor:
        rests = evaluate_rests(vertices)
        state = ClusteredRests.of(rests, clusters.directions, np.full(3, 1 / 3))
        return energy_terms(state, options)[name]

    vertices = torch.tensor(points, requires_grad=True)
    assert float(value(vertices).detach()) > 1e-3
    assert torch.autograd.gradcheck(value, (vertices,), eps=1e-6, atol=1e-6, rtol=1e-5)

    plain, slope = vertices.detach(), torch.func.grad(value)
    (expected,) = torch.autograd.grad(value(vertices), vertices)
    torch.testing.assert_close(slope(plain), expected)
    along = torch.tensor(np.random.default_rng(1).normal(size=points.shape))
    second = torch.func.hessian(value)(plain).reshape(points.size, points.size)
    torch.testing.assert_close(second, second.T, atol=1e-9, rtol=1e-9)
    change = (slope(plain + 1e-6 * along) - slope(plain - 1e-6 * along)) / 2e-6
    torch.testing.assert_close(second @ along.ravel(), change.ravel(), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("seed", [1, 4, 8])
def test_an_outcome_without_a_rest_has_a_finite_cost(random_points, seed: int) -> None:
    """It has the direction of another outcome; the other clusters do not change."""
    rests, clusters = case(random_points(seed, 14, ROUND), 3, seed)
    normals = rests.rest_normals.detach().numpy()
    twin = cluster(normals, np.concatenate([clusters.directions, clusters.directions[:1]]))
    np.testing.assert_array_equal(twin.of_rest, clusters.of_rest)
    assert (clusters.empty, twin.empty) == (0, 1)
    weights = EnergyWeights(neighbor_radius=0.3)
    target = np.array([0.4, 0.3, 0.2])
    full = energy_terms(ClusteredRests(rests, clusters, target), weights)
    state = ClusteredRests(rests, twin, np.append(target, 0.1))
    gain = {
        name: float((term - full[name]).detach())
        for name, term in energy_terms(state, weights).items()
    }
    assert gain["dice"] == pytest.approx(0.01)
    assert gain["barycenter"] == pytest.approx(4.0 * weights.barycenter)
    assert gain["coplanar"] == 0.0
    assert gain["neighbor"] > 0.0
    assert np.isfinite(Energy(state, weights).gradient).all()
