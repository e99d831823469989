"""Preferences among dice: closed forms of each term, and gradients along the manifold."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import torch
from common.stones import stone

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.facet_measures import SOFTNESS
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.preferences import (
    USUAL_CIRCLE,
    USUAL_HELPERS,
    USUAL_INEQUALITY,
    USUAL_OFFSET,
    USUAL_RATIO,
    USUAL_SPREAD,
    OutcomeFacets,
    Preferences,
    preference_residuals,
)
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.rest.morse import basin_moments, separatrix_points
from dicedesign.rest.poses import rest_poses

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))
BOX = np.array([1.0, 1.5, 2.0])
TERMS = ["circles", "margin", "asymmetry", "roundness", "areas", "small_helpers", "tolerance"]


def evaluate(points: np.ndarray) -> RestEvaluation:
    return evaluate_rests(torch.tensor(points, dtype=torch.float64))


def only(name: str, weight: float = 1.0) -> Preferences:
    return Preferences(**{name: weight})


def total(rests: RestEvaluation, name: str, facets: np.ndarray | None = None) -> float:
    """Sum of squares of a preference. facets: of the outcomes; all stable ones by default."""
    bearing = np.flatnonzero(rests.equilibria.stable) if facets is None else facets
    (residuals,) = preference_residuals(OutcomeFacets(rests, bearing), only(name))
    return float((residuals.detach() ** 2).sum())


def die(seed: int) -> Candidate:
    """A die without symmetry, with facets that are no rests, in facet coordinates."""
    points = stone(seed)
    hull = convex_hull(points)
    coordinates, parameters = FacetCoordinates.of(points, hull.centroid)
    candidate = CandidateMaker(None).attempt(coordinates, parameters, rest_poses(points).normals)
    assert candidate is not None
    return candidate


def test_a_cube_has_nothing_to_improve_but_its_circles() -> None:
    rests = evaluate(3.0 * CUBE)
    for name in ("margin", "asymmetry", "roundness", "areas", "small_helpers"):
        assert total(rests, name) == pytest.approx(0.0, abs=1e-24)
    power = 2.0 * SOFTNESS
    diameter = (4 * 12 ** (power / 2) + 12 * 8 ** (power / 2) + 12 * 2**power) ** (1 / power)
    assert total(rests, "circles") == pytest.approx((USUAL_CIRCLE * diameter) ** 2 / 6)


def test_the_asymmetry_roundness_and_areas_of_a_box() -> None:
    rests = evaluate(CUBE * BOX)
    axes = np.abs(rests.hull.normals).argmax(axis=1)
    probabilities = dict(zip(axes[rests.paths.rests], rests.probability_values, strict=True))
    expected = 0.0
    for first, second in ((0, 1), (1, 2), (2, 0)):
        angle = np.arctan2(BOX[second], BOX[first])
        unequal = 2.0 * angle / (np.pi / 2) - 1.0
        expected += 4 * min(probabilities[first], probabilities[second]) * unequal**2
    assert total(rests, "asymmetry") == pytest.approx(expected / USUAL_INEQUALITY**2)
    spread = np.var(BOX) / BOX.mean() ** 2
    assert total(rests, "roundness") == pytest.approx(spread / USUAL_SPREAD**2)
    areas = np.log(BOX.prod() / BOX)
    assert total(rests, "areas") == pytest.approx(np.var(areas) / USUAL_RATIO**2)
    equal = np.flatnonzero(axes == 0)
    assert total(rests, "areas", equal) == pytest.approx(0.0, abs=1e-24)
    part = 1.0 - (1 / BOX[0]) / (1 / BOX).sum()
    assert total(rests, "small_helpers", equal) == pytest.approx((part / USUAL_HELPERS) ** 2)


def test_the_margin_is_the_distance_of_normals_from_barycenters() -> None:
    candidate = die(0)
    rests, paths = candidate.rests, candidate.rests.paths
    points = separatrix_points(paths, rests.hull.vertices, rests.equilibria.center_of_mass, np)
    offsets = rests.hull.normals[paths.rests] - unit_vectors(basin_moments(paths, points, np))
    expected = (offsets**2).sum(-1).mean() / USUAL_OFFSET**2
    assert total(rests, "margin", candidate.outcome_facets) == pytest.approx(expected)


def test_weights_multiply_the_terms() -> None:
    candidate = die(1)
    facets = candidate.outcome_facets
    weights = dict(zip(TERMS, [0.5, 2.0, 1.0, 0.0, 3.0, 0.25, 0.75], strict=True))
    residuals = preference_residuals(OutcomeFacets(candidate.rests, facets), Preferences(**weights))
    expected = sum(weights[name] * total(candidate.rests, name, facets) for name in TERMS)
    assert float((torch.cat(residuals).detach() ** 2).sum()) == pytest.approx(expected)
    assert preference_residuals(OutcomeFacets(candidate.rests, facets), Preferences()) == []


def test_terms_do_not_depend_on_size_and_place() -> None:
    vertices = die(2).rests.hull.vertices
    there = 7.0 * vertices + [3.0, -1.0, 2.0]
    for name in TERMS:
        # Some facets bear no outcome, for the helpers' sake.
        facets = None if name == "margin" else np.arange(5)
        value = total(evaluate(there), name, facets)
        assert value == pytest.approx(total(evaluate(vertices), name, facets)), name
        assert value > 1e-6


@pytest.mark.parametrize("name", TERMS)
def test_gradients_are_differences_along_the_manifold(name: str) -> None:
    candidate, step, tolerance = die(1), 1e-5, 1e-6
    count = len(candidate.outcome_facets)
    assert count < len(candidate.rests.hull.normals)
    free = np.linalg.svd(candidate.probability_jacobian)[2][count:]
    along = np.random.default_rng(1).normal(size=len(free)) @ free
    maker = CandidateMaker(None, model=candidate.model)

    def residuals(there: Candidate) -> torch.Tensor:
        facets = OutcomeFacets(there.rests, there.outcome_facets)
        return preference_residuals(facets, only(name))[0]

    def values(moved: float) -> np.ndarray:
        there = maker.move(candidate, candidate.parameters + moved * along)
        assert there is not None
        return residuals(there).detach().numpy()

    slopes = candidate.jacobian(residuals(candidate)) @ along
    differences = (values(step) - values(-step)) / (2 * step)
    assert np.abs(slopes).max() > 1e-3
    np.testing.assert_allclose(slopes, differences, rtol=10 * tolerance, atol=tolerance)
