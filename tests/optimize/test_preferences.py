"""Preferences: closed forms of each term, gradients along the manifold, and dice that are improved
and keep their probabilities."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np
import pytest
import torch
from common.stones import stone

from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.point_groups import point_group
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.gradient.facet_measures import SOFTNESS, circle_radii
from dicedesign.gradient.rest_probabilities import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates import Coordinates, FacetCoordinates, SymmetricCoordinates
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
from dicedesign.optimize.solvers import null_space_descent
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.optimize.solvers.null_space_descent import NullSpaceDescent, barrier_residuals
from dicedesign.rest.morse import basin_moments, separatrix_points
from dicedesign.rest.poses import rest_poses

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))
BOX = np.array([1.0, 1.5, 2.0])
TERMS = ["circles", "margin", "asymmetry", "roundness", "areas", "small_helpers", "tolerance"]


TOLERANCE = 1e-12
CIRCLES = Preferences(circles=1.0)
IMPROVED = TERMS[:-1]
MIXED = Preferences(**{**dict.fromkeys(IMPROVED, 0.3), "circles": 1.0})


@dataclass
class Run:
    """A die, the one it became, and those on the way; its probabilities are to be kept."""

    first: Candidate
    maker: CandidateMaker
    on_the_way: list[Candidate] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    phases: int = 1

    def improved(
        self,
        preferences: Preferences,
        least_circle: float = 0.0,
        steps: int = 60,
    ) -> Candidate:
        self.phases = 2 if least_circle > 0.0 else 1
        descent = NullSpaceDescent(
            target=self.first.probabilities.copy(),
            maker=self.maker,
            preferences=preferences,
            least_circle=least_circle,
            tolerance=TOLERANCE,
            out_of_time=lambda: False,
            on_step=self.take_note,
        )
        self.last = descent.improve(self.first, steps)
        return self.last

    def take_note(self, candidate: Candidate, value: float) -> None:
        self.on_the_way.append(candidate)
        self.values.append(value)

    def check(self) -> None:
        """Check all dice by the forward model, which shares no code with the method."""
        target = self.first.probabilities
        assert (self.on_the_way or [self.first])[-1] is self.last
        assert (np.diff(self.values) >= 0.0).sum() < self.phases
        for candidate in self.on_the_way:
            poses = rest_poses(candidate.rests.hull.vertices, self.maker.center_of_mass)
            assert len(poses.normals) == len(target)
            outcome = np.argmax(poses.normals @ candidate.directions.T, axis=1)
            assert sorted(outcome) == list(range(len(target)))
            assert np.abs(poses.probabilities - target[outcome]).max() <= 2.0 * TOLERANCE


def start(
    coordinates: Coordinates,
    parameters: np.ndarray,
    points: np.ndarray,
    center: np.ndarray | None = None,
) -> Run:
    maker = CandidateMaker(center)
    candidate = maker.attempt(coordinates, parameters, rest_poses(points, center).normals)
    assert candidate is not None
    return Run(candidate, maker)


def facet_run(seed: int, facets: int = 8) -> Run:
    points = stone(seed, facets)
    return start(*FacetCoordinates.of(points, convex_hull(points).centroid), points)


def evaluate(points: np.ndarray) -> RestEvaluation:
    return evaluate_rests(torch.tensor(points, dtype=torch.float64))


def total(rests: RestEvaluation, name: str, facets: np.ndarray | None = None) -> float:
    """Sum of squares of a preference. facets: of the outcomes; all stable ones by default."""
    bearing = np.flatnonzero(rests.equilibria.stable) if facets is None else facets
    (residuals,) = preference_residuals(OutcomeFacets(rests, bearing), Preferences(**{name: 1.0}))
    return float((residuals.detach() ** 2).sum())


def value(candidate: Candidate, preferences: Preferences) -> float:
    """Weighted sum of the preferences."""
    return sum(
        weight * total(candidate.rests, name, candidate.outcome_facets)
        for name, weight in preferences.as_dict().items()
        if weight > 0.0
    )


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
    candidate = facet_run(0, 9).first
    rests, paths = candidate.rests, candidate.rests.paths
    points = separatrix_points(paths, rests.hull.vertices, rests.equilibria.center_of_mass, np)
    offsets = rests.hull.normals[paths.rests] - unit_vectors(basin_moments(paths, points, np))
    expected = (offsets**2).sum(-1).mean() / USUAL_OFFSET**2
    assert total(rests, "margin", candidate.outcome_facets) == pytest.approx(expected)


def test_terms_do_not_depend_on_size_and_place() -> None:
    vertices = facet_run(2, 9).first.rests.hull.vertices
    there = 7.0 * vertices + [3.0, -1.0, 2.0]
    for name in TERMS:
        # Some facets bear no outcome, for the helpers' sake.
        facets = None if name == "margin" else np.arange(5)
        value = total(evaluate(there), name, facets)
        assert value == pytest.approx(total(evaluate(vertices), name, facets)), name
        assert value > 1e-6


@pytest.mark.parametrize("name", TERMS)
def test_gradients_are_differences_along_the_manifold(name: str) -> None:
    candidate, step, tolerance = facet_run(1, 9).first, 1e-5, 1e-6
    count = len(candidate.outcome_facets)
    assert count < len(candidate.rests.hull.normals)
    free = np.linalg.svd(candidate.probability_jacobian)[2][count:]
    along = np.random.default_rng(1).normal(size=len(free)) @ free
    maker = CandidateMaker(None, model=candidate.model)

    def residuals(there: Candidate) -> torch.Tensor:
        facets = OutcomeFacets(there.rests, there.outcome_facets)
        return preference_residuals(facets, Preferences(**{name: 1.0}))[0]

    def values(moved: float) -> np.ndarray:
        there = maker.move(candidate, candidate.parameters + moved * along)
        assert there is not None
        return residuals(there).detach().numpy()

    slopes = candidate.jacobian(residuals(candidate)) @ along
    differences = (values(step) - values(-step)) / (2 * step)
    assert np.abs(slopes).max() > 1e-3
    np.testing.assert_allclose(slopes, differences, rtol=10 * tolerance, atol=tolerance)


def smallest(candidate: Candidate) -> float:
    return circle_radii(candidate.rests, candidate.outcome_facets).detach().min().item()


@pytest.mark.parametrize("name", IMPROVED)
def test_every_preference_improves_its_objective(name: str) -> None:
    # The die of seed 3 has facets without an outcome.
    run = facet_run(3 if name == "small_helpers" else 1)
    preferences = Preferences(**{name: 1.0})
    improved = run.improved(preferences, steps=15)
    run.check()
    assert value(improved, preferences) < 0.9 * value(run.first, preferences)


def merit(candidate: Candidate) -> float:
    """Objective of the descent for large circles."""
    barrier = barrier_residuals(candidate.rests).detach()
    return value(candidate, CIRCLES) + float((barrier**2).sum())


def best_gain(candidate: Candidate, maker: CandidateMaker) -> float:
    """The largest relative decrease by small moves in random directions that change no
    probabilities."""
    free = np.linalg.svd(candidate.probability_jacobian)[2][len(candidate.probabilities) :]
    gains = []
    for direction in unit_vectors(np.random.default_rng(0).normal(size=(40, len(free)))):
        parameters = candidate.parameters + 1e-3 * direction @ free
        there = maker.attempt(candidate.coordinates, parameters, candidate.directions)
        assert there is not None
        gains.append(1.0 - merit(there) / merit(candidate))
    return max(gains)


def test_the_descent_ends_near_a_local_minimum() -> None:
    run = facet_run(2)
    improved = run.improved(CIRCLES, steps=200)
    assert best_gain(improved, run.maker) < 0.1 * best_gain(run.first, run.maker)


@pytest.mark.parametrize("most_rows", [null_space_descent.MOST_ROWS, 0])
def test_mixed_preferences_with_a_given_center_of_mass(
    monkeypatch: pytest.MonkeyPatch, most_rows: int
) -> None:
    """By a Jacobian, and without one as for many residuals."""
    monkeypatch.setattr(null_space_descent, "MOST_ROWS", most_rows)
    points = stone(3, 8)
    hull = convex_hull(points)
    center = hull.centroid + np.array([0.03, -0.02, 0.01])
    run = start(*FacetCoordinates.of(points, center), points, center)
    facets = OutcomeFacets(run.first.rests, run.first.outcome_facets)
    residuals = torch.cat(preference_residuals(facets, MIXED)).detach()
    assert float((residuals**2).sum()) == pytest.approx(value(run.first, MIXED))
    improved = run.improved(MIXED)
    run.check()
    assert value(improved, MIXED) < 0.9 * value(run.first, MIXED)


def test_symmetry_that_causes_ties_is_kept() -> None:
    """The Jacobian of the probabilities has half the rank then."""
    rng = np.random.default_rng(0)
    normals = unit_vectors(np.eye(3)[[0, 1, 2, 0]] + 0.3 * rng.normal(size=(4, 3)))
    points = polyhedron_corners(
        np.concatenate([normals, -normals]), np.tile(rng.uniform(0.9, 1.2, size=4), 2)
    )
    coordinates, parameters = SymmetricCoordinates.of(points, np.zeros(3), point_group("Ci"))
    run = start(coordinates, parameters, points)
    probabilities = np.sort(run.first.probabilities)
    np.testing.assert_allclose(probabilities[::2], probabilities[1::2], atol=1e-14)
    assert np.linalg.matrix_rank(run.first.probability_jacobian, 1e-9) == len(probabilities) / 2 - 1
    improved = run.improved(CIRCLES)
    run.check()
    assert smallest(improved) > 1.05 * smallest(run.first)


def test_a_required_circle_is_reached_and_then_kept() -> None:
    run = facet_run(1)
    least = 1.2 * smallest(run.first)
    reached = run.improved(Preferences(), least)
    run.check()
    assert smallest(reached) >= least
    # Nothing was preferred, so that it ended there.
    assert all(smallest(candidate) < least for candidate in run.on_the_way[:-1])

    then = Run(reached, run.maker)
    preferences = Preferences(small_helpers=1.0, margin=1.0)
    free, bound = Run(reached, run.maker).improved(preferences), then.improved(preferences, least)
    then.check()
    assert min(map(smallest, then.on_the_way)) >= least > smallest(free)
    assert value(bound, preferences) < value(reached, preferences)
