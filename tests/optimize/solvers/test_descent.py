"""Designs, judged by the forward model alone."""

from __future__ import annotations

import dataclasses
import re
from functools import cache

import numpy as np
import pytest
from common.slow_machine import slow_machine

from dicedesign import rest_poses
from dicedesign.errors import DiceError, InputError, OutsideHullError
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.energy.objective import Objective
from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.optimize.options import DescentOptions, SobolevOptions, Stopping
from dicedesign.optimize.result import DesignResult, DesignStep
from dicedesign.optimize.solvers.descent import descend_to_target
from dicedesign.optimize.starts.kinds.hendecahedron import hendecahedron
from dicedesign.optimize.starts.kinds.prism import prism
from dicedesign.optimize.starts.repulsion import repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import Target, binomial, fair, listed, sum_of_dice
from dicedesign.results.status import Status

DESIGNS: dict[str, tuple[Start, Target]] = {
    "2d6": (hendecahedron("circus"), sum_of_dice([6, 6])),
    "binomial2": (prism(3), binomial(2)),
    "d6": (repulsion(6, 2), listed([0.1, 0.1, 0.2, 0.2, 0.2, 0.2])),
}


@cache
def designed(name: str) -> DesignResult:
    start, target = DESIGNS[name]
    return descend_to_target(start, target.probabilities, DescentOptions())


def brief(steps: int, **options) -> DescentOptions:
    return DescentOptions(stopping=Stopping(steps=steps), **options)


def outcome_error(
    result: DesignResult, target: np.ndarray, center: np.ndarray | None = None
) -> float:
    """Largest |p - q| by the forward model, each rest counted for the nearest direction."""
    poses = rest_poses(result.hull.vertices, center)
    nearest = np.argmax(poses.normals @ result.directions.T, axis=1)
    sums = np.zeros(len(target))
    for outcome, probability in zip(nearest, poses.probabilities, strict=True):
        sums[outcome] += probability
    return float(np.abs(sums - target).max())


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_a_design_reaches_its_target_with_one_rest_for_each_outcome(name: str) -> None:
    _, target = DESIGNS[name]
    result = designed(name)
    assert result.status is Status.CONVERGED
    poses = rest_poses(result.hull.vertices)
    assert len(poses.normals) == len(target.labels)
    nearest = np.argmax(poses.normals @ result.directions.T, axis=1)
    assert sorted(nearest.tolist()) == list(range(len(target.labels)))
    np.testing.assert_allclose(
        poses.probabilities, target.probabilities[nearest], atol=1e-3, rtol=0.0
    )
    np.testing.assert_allclose(result.directions[nearest], poses.normals, atol=1e-12)


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_the_recorded_error_is_that_of_the_returned_hull(name: str) -> None:
    result = designed(name)
    recorded = result.history[-1].error
    assert outcome_error(result, DESIGNS[name][1].probabilities) == pytest.approx(
        recorded, abs=1e-12
    )


@pytest.mark.parametrize("name", sorted(DESIGNS))
def test_history_tells_every_step_in_order(name: str) -> None:
    history = designed(name).history
    assert [step.step for step in history] == list(range(len(history)))
    seconds = [step.seconds for step in history]
    assert seconds == sorted(seconds)
    assert seconds[0] >= 0.0
    for step in history:
        assert step.energy == pytest.approx(sum(step.terms.values()), rel=1e-12)
        assert all(np.isfinite(value) and value >= 0.0 for value in step.terms.values())
    assert set(history[0].terms) == {"dice", "coplanar", "barycenter", "neighbor", "stability"}
    assert history[-1].energy < history[0].energy


def test_the_first_entry_is_the_start() -> None:
    start, target = DESIGNS["2d6"]
    result = descend_to_target(start, target.probabilities, brief(0, perturbation=0.0))
    assert len(result.history) == 1
    assert result.evaluations == 1
    poses = rest_poses(start.points)
    place = np.argmax(start.directions @ poses.normals.T, axis=1)
    expected = poses.probabilities[place] - target.probabilities
    first = result.history[0]
    assert first.error == pytest.approx(np.abs(expected).max(), abs=1e-10)
    assert first.terms["dice"] == pytest.approx((expected**2).sum(), rel=1e-9)
    assert first.terms["coplanar"] == 0.0
    np.testing.assert_allclose(result.directions, start.directions, atol=1e-10)


def test_every_accepted_step_is_announced_as_it_is_recorded() -> None:
    start, target = DESIGNS["d6"]
    seen: list[DesignStep] = []
    result = descend_to_target(start, target.probabilities, brief(5), on_step=seen.append)
    assert tuple(seen) == result.history
    assert len(seen) == 6


@pytest.mark.parametrize("pruning", [False, True])
def test_evaluations_count_rejected_trials_and_those_after_pruning(
    monkeypatch, random_points, pruning: bool
) -> None:
    calls = []
    evaluate = Objective.evaluate

    def counted(self, parameters, directions):
        calls.append(len(parameters))
        return evaluate(self, parameters, directions)

    monkeypatch.setattr(Objective, "evaluate", counted)
    start, target = DESIGNS["2d6"]
    options = brief(60)
    if pruning:
        start = Start(random_points(3, 120, (1.0, 0.95, 1.1)), start.directions)
        options = brief(10, coordinates="vertices")
    result = descend_to_target(start, target.probabilities, options)
    assert result.evaluations == len(calls) > len(result.history)
    assert (min(calls) < max(calls)) is pruning


def test_the_step_limit_ends_a_design() -> None:
    start, target = DESIGNS["2d6"]
    for steps in (0, 3):
        result = descend_to_target(start, target.probabilities, brief(steps))
        assert result.status is Status.STEP_LIMIT
        assert len(result.history) == steps + 1
    assert "allow more steps" in result.status.value


def test_the_time_limit_ends_a_design() -> None:
    start, target = DESIGNS["2d6"]
    options = DescentOptions(stopping=Stopping(seconds=1e-6))
    result = descend_to_target(start, target.probabilities, options)
    assert result.status is Status.TIME_LIMIT
    assert len(result.history) == 1


def test_a_slow_machine_makes_the_same_die() -> None:
    start, target = DESIGNS["d6"]
    with slow_machine():
        slow = descend_to_target(start, target.probabilities, DescentOptions())
    usual = designed("d6")
    assert slow.hull.vertices.tobytes() == usual.hull.vertices.tobytes()
    assert slow.status is usual.status
    assert slow.history[-1].seconds > 1e6


def test_a_limit_does_not_hide_that_the_tolerance_was_reached() -> None:
    start = repulsion(4, 0)
    for stopping in (Stopping(0.05, steps=0), Stopping(0.05, seconds=1e-6)):
        options = DescentOptions(stopping=stopping)
        result = descend_to_target(start, fair(4).probabilities, options)
        assert result.history[-1].error < 0.05
        assert result.status is Status.CONVERGED


def test_an_impossible_target_ends_without_progress() -> None:
    """The centroid of a tetrahedron is too far from three of the facets for such odds."""
    start = repulsion(4, 0)
    target = np.array([0.97, 0.01, 0.01, 0.01])
    result = descend_to_target(start, target, DescentOptions())
    assert result.status is Status.NO_PROGRESS
    assert result.history[-1].error > 0.1
    assert np.isfinite(result.hull.vertices).all()


def test_a_seed_decides_everything() -> None:
    start, target = DESIGNS["d6"]
    runs = [
        descend_to_target(start, target.probabilities, brief(12), seed=seed) for seed in (4, 4, 5)
    ]
    np.testing.assert_array_equal(runs[0].hull.vertices, runs[1].hull.vertices)
    np.testing.assert_array_equal(runs[0].directions, runs[1].directions)
    assert [s.energy for s in runs[0].history] == [s.energy for s in runs[1].history]
    assert runs[0].evaluations == runs[1].evaluations
    assert runs[0].history[0].energy != runs[2].history[0].energy


@pytest.mark.parametrize("sobolev", [None, SobolevOptions()])
@pytest.mark.parametrize("name", ["d6", "2d6"])
def test_vertex_coordinates_lower_the_energy(name: str, sobolev: SobolevOptions | None) -> None:
    start, target = DESIGNS[name]
    weights = EnergyWeights(stability=0.0)
    options = brief(15, coordinates="vertices", sobolev=sobolev, weights=weights)
    result = descend_to_target(start, target.probabilities, options)
    assert result.history[-1].step > 0
    assert result.history[-1].energy < 0.9 * result.history[0].energy
    expected = outcome_error(result, target.probabilities)
    assert result.history[-1].error == pytest.approx(expected, abs=1e-12)


def test_the_paper_s_energy_on_a_dense_hull_keeps_more_vertices_with_sobolev(
    random_points,
) -> None:
    points = random_points(3, 120, (1.0, 0.95, 1.1))
    directions = np.array([(1.0, 0.0, 0.0), (-0.5, 0.8660254, 0.0), (-0.5, -0.8660254, 0.0)])
    target = fair(3).probabilities
    kept = []
    for sobolev in (None, SobolevOptions()):
        options = brief(
            10, coordinates="vertices", sobolev=sobolev, weights=EnergyWeights(stability=0.0)
        )
        result = descend_to_target(Start(points, directions), target, options)
        assert result.history[-1].energy < result.history[0].energy
        assert result.history[-1].error == pytest.approx(outcome_error(result, target), abs=1e-12)
        kept.append(len(result.hull.vertices))
    assert kept[1] >= kept[0]


@pytest.mark.parametrize("coordinates", ["facets", "vertices"])
def test_a_fixed_center_of_mass_stays_as_given(coordinates) -> None:
    start, target = DESIGNS["d6"]
    center = rest_poses(start.points).center_of_mass + np.array([0.1, -0.05, 0.02])
    given = center.copy()
    result = descend_to_target(
        start, target.probabilities, brief(30, coordinates=coordinates), center_of_mass=center
    )
    np.testing.assert_array_equal(center, given)
    error = outcome_error(result, target.probabilities, center)
    assert result.history[-1].error == pytest.approx(error, abs=1e-12)
    assert result.history[-1].energy < result.history[0].energy
    uniform = outcome_error(result, target.probabilities)
    assert abs(uniform - error) > 1e-4


def test_a_center_of_mass_near_the_boundary_is_worked_with() -> None:
    start, target = DESIGNS["d6"]
    poses = rest_poses(start.points)
    corner = poses.hull.vertices[0]
    center = corner + 1e-6 * (poses.center_of_mass - corner)
    result = descend_to_target(start, target.probabilities, brief(5), center_of_mass=center)
    assert all(np.isfinite(step.energy) for step in result.history)
    assert outcome_error(result, target.probabilities, center) == pytest.approx(
        result.history[-1].error, abs=1e-9
    )


@pytest.mark.parametrize(
    ("start", "target"),
    [
        (prism(4), binomial(3)),
        (hendecahedron("bisymmetric"), sum_of_dice([6, 6])),
        (prism(12), fair(12)),
    ],
    ids=["prism4", "bisymmetric", "prism12"],
)
def test_symmetric_starts_without_perturbation(start: Start, target: Target) -> None:
    options = brief(15, perturbation=0.0)
    result = descend_to_target(start, target.probabilities, options)
    assert all(np.isfinite(step.energy) for step in result.history)
    assert np.isfinite(result.hull.vertices).all()
    assert result.history[-1].energy <= result.history[0].energy


def test_a_tiny_probability_and_many_outcomes() -> None:
    odds = np.full(6, (1.0 - 1e-4) / 5.0)
    odds[0] = 1e-4
    few = descend_to_target(repulsion(6, 0), odds, brief(60))
    assert few.history[-1].error < 0.5 * few.history[0].error
    many = descend_to_target(repulsion(30, 0), fair(30).probabilities, brief(60))
    assert len(rest_poses(many.hull.vertices).normals) == 30
    assert many.history[-1].error < 1e-3


@pytest.mark.parametrize("name", ["coplanar", "barycenter", "neighbor", "stability"])
def test_a_huge_weight_gives_no_nonsense(name: str) -> None:
    start, target = DESIGNS["d6"]
    options = brief(10, weights=EnergyWeights(**{name: 1e6}))
    result = descend_to_target(start, target.probabilities, options)
    energies = [step.energy for step in result.history]
    assert np.isfinite(energies).all()
    assert min(energies) <= energies[0]


def test_more_outcomes_than_facets_is_worked_with() -> None:
    start = repulsion(4, 0)
    crowded = Start(start.points, np.concatenate([start.directions, [[0.0, 0.6, 0.8]]]))
    result = descend_to_target(crowded, fair(5).probabilities, brief(3))
    assert result.status in (Status.STEP_LIMIT, Status.NO_PROGRESS)
    assert result.history[-1].error == pytest.approx(0.2)


def test_the_gradient_of_the_whole_energy_is_its_difference() -> None:
    for name, (start, target) in DESIGNS.items():
        coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
        rng = np.random.default_rng(1)
        parameters = parameters + 0.02 * rng.normal(size=parameters.shape)
        weights = EnergyWeights(neighbor_radius=0.5, stability_margin=0.3)
        objective = Objective(coordinates, target.probabilities, weights, None)
        here = objective.evaluate(parameters, start.directions)
        along = rng.normal(size=parameters.shape)
        above, below = (
            objective.evaluate(parameters + sign * 1e-6 * along, start.directions).value
            for sign in (1.0, -1.0)
        )
        slope = float(here.gradient @ along)
        assert (above - below) / 2e-6 == pytest.approx(slope, rel=1e-5), name


def test_an_attempt_fails_quietly_where_there_is_no_solid() -> None:
    start, target = DESIGNS["2d6"]
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    objective = Objective(coordinates, target.probabilities, EnergyWeights(), None)
    assert objective.attempt(parameters, start.directions) is not None
    for bad in (np.full_like(parameters, np.nan), np.zeros_like(parameters)):
        assert objective.attempt(bad, start.directions) is None
        with pytest.raises(DiceError):
            objective.evaluate(bad, start.directions)


def test_flaws_are_lost_outcomes_and_rests_too_many() -> None:
    start, _ = DESIGNS["d6"]
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    twin = np.concatenate([start.directions, start.directions[:1]])
    for directions, lost, extra in (
        (start.directions, 0, 0),
        (start.directions[:4], 0, 2),
        (twin, 1, 0),
        (np.concatenate([twin[1:4], twin[1:2]]), 1, 3),
    ):
        target = np.full(len(directions), 1.0 / len(directions))
        for stability in (0.1, 0.0):
            weights = EnergyWeights(stability=stability)
            objective = Objective(coordinates, target, weights, None)
            flaws = objective.evaluate(parameters, directions).flaws
            assert flaws == lost + (extra if stability else 0)


def test_refreshed_and_under_keep_the_shape() -> None:
    start, target = DESIGNS["d6"]
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    objective = Objective(coordinates, target.probabilities, EnergyWeights(), None)
    turned = start.directions + 0.05
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    point = objective.evaluate(parameters, turned)
    refreshed = point.refreshed()
    assert refreshed.rests is point.rests
    np.testing.assert_allclose(refreshed.directions, start.directions, atol=1e-12)
    lighter = dataclasses.replace(objective, weights=EnergyWeights(barycenter=0.5))
    other = refreshed.under(lighter)
    assert other.rests is point.rests
    barycenter = [e.values["barycenter"] for e in (refreshed, other)]
    assert barycenter[1] == pytest.approx(barycenter[0] / 4.0)


@pytest.mark.parametrize(
    ("target", "center", "error", "text"),
    [
        (
            [0.5, 0.5],
            None,
            InputError,
            "target: expected 6 outcomes, one for each direction of the start, got 2",
        ),
        (
            [1 / 6] * 6,
            [4.0, 0.0, 0.0],
            OutsideHullError,
            "center of mass: expected a point strictly inside the hull, got [4.0, 0.0, 0.0]",
        ),
        (
            [1 / 6] * 6,
            [np.nan, 0.0, 0.0],
            InputError,
            "center of mass: expected three finite numbers",
        ),
        ([1 / 6] * 6, [0.0, 0.0], InputError, "center of mass: expected three finite numbers"),
    ],
)
@pytest.mark.parametrize("coordinates", ["facets", "vertices"])
def test_bad_requests_are_refused_in_words(target, center, error, text, coordinates) -> None:
    middle = None if center is None else np.array(center)
    options = brief(1, coordinates=coordinates)
    with pytest.raises(error, match=re.escape(text)):
        descend_to_target(DESIGNS["d6"][0], np.array(target), options, center_of_mass=middle)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            lambda: DescentOptions(coordinates="edges"),  # type: ignore[arg-type]
            'coordinates: expected "facets" or "vertices", got \'edges\'',
        ),
        (
            lambda: DescentOptions(sobolev=SobolevOptions()),
            'sobolev: expected coordinates "vertices", whose gradient lives on the surface, got '
            "'facets'; leave sobolev out or change coordinates",
        ),
        (
            lambda: DescentOptions(relaxation=1.0),
            "relaxation: expected a number in (0, 1), got 1",
        ),
        (lambda: DescentOptions(relaxation=0.0), "expected a number in (0, 1), got 0"),
        (
            lambda: DescentOptions(perturbation=-1e-3),
            "perturbation: expected a number in [0, 1), got -0.001",
        ),
        (lambda: DescentOptions(perturbation=np.nan), "expected a number in [0, 1), got nan"),
        (lambda: Stopping(tolerance=0.0), "tolerance: expected a number in (0, 1), got 0"),
        (lambda: Stopping(tolerance=1.0), "tolerance: expected a number in (0, 1), got 1"),
        (lambda: Stopping(steps=-1), "steps: expected a whole number not below 0, got -1"),
        (lambda: Stopping(seconds=0.0), "seconds: expected a positive number, got 0"),
        (lambda: Stopping(seconds=np.inf), "seconds: expected a positive number, got inf"),
        (lambda: Stopping(seconds=np.nan), "seconds: expected a positive number, got nan"),
    ],
)
def test_bad_options_are_refused_in_words(make, text: str) -> None:
    with pytest.raises(InputError, match=re.escape(text)):
        make()


def test_limits_are_told_by_name() -> None:
    stopping = Stopping(steps=10, seconds=5.0)
    assert stopping.limit(9, 4.9) is None
    assert stopping.limit(10, 0.0) is Status.STEP_LIMIT
    assert stopping.limit(0, 5.0) is Status.TIME_LIMIT
    assert len({status.value for status in Status}) == len(Status)
