"""Designs that are hard on the method: every accepted step is whole, and the end gives a reason."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull as QhullHull

from dicedesign import rest_poses
from dicedesign.bench.benches.stability import run_case
from dicedesign.bench.bodies.problem import DesignProblem, Problem
from dicedesign.bench.bodies.stability_suite import stability_cases
from dicedesign.bench.bodies.stiff_designs import (
    coincident,
    design_cases,
    leaning,
    loaded_box,
    near_facet,
)
from dicedesign.bench.measures.designs.watched_design import step_faults, watch_design
from dicedesign.bench.reference.measurement import OK
from dicedesign.bench.reference.oracle import hull_probabilities
from dicedesign.errors import DegenerateBodyError
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.optimize.coordinates.vertices import VertexCoordinates
from dicedesign.optimize.energy.clusters import ClusteredRests, cluster
from dicedesign.optimize.energy.objective import Evaluation, Objective
from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.optimize.energy.terms.barycenter import barycenter_energy
from dicedesign.optimize.energy.terms.stability import stability_energy
from dicedesign.optimize.paper_options import PaperOptions
from dicedesign.optimize.solvers.line_search import LineSearch
from dicedesign.optimize.solvers.paper import descend_as_paper
from dicedesign.optimize.starts.repulsion import repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import fair, listed
from dicedesign.results.status import Status

CASES = {case.name.removeprefix("design: "): case for case in design_cases()}
QUICK = [name for name, case in CASES.items() if case.quick]
OTHERS = [
    name for name in CASES if name not in QUICK and not name.endswith(("with finish", "29 coins"))
]


def problem(name: str) -> DesignProblem:
    built = CASES[name].build()
    assert isinstance(built, DesignProblem)
    return built


def oracle_error(design: DesignProblem, vertices: np.ndarray, directions: np.ndarray) -> float:
    """Largest |p - q| in 60-digit arithmetic, each rest counted for the nearest direction."""
    poses = rest_poses(vertices, design.center_of_mass)
    hull = poses.hull
    exact = hull_probabilities(hull, [poses.center_of_mass])
    sums = np.zeros(len(design.target))
    for normal, probability in zip(hull.normals, exact, strict=True):
        sums[np.argmax(directions @ normal)] += float(probability)
    assert sums.sum() == pytest.approx(1.0, abs=1e-12)
    return float(np.abs(sums - design.target).max())


@pytest.mark.parametrize("name", QUICK)
def test_the_short_designs_converge_and_every_step_is_whole(name: str) -> None:
    design = problem(name)
    watched = watch_design(design)
    assert watched.faults == ()
    assert watched.result is not None
    assert watched.result.status is Status.CONVERGED, watched.ending
    assert np.isfinite(watched.largest_derivative)
    assert watched.steps == len(watched.result.history)
    vertices, directions = watched.result.hull.vertices, watched.result.directions
    error = oracle_error(design, vertices, directions)
    assert error <= design.tolerance + 1e-12
    assert watched.error == pytest.approx(error, abs=1e-15)


@pytest.mark.parametrize("name", OTHERS)
def test_the_others_are_whole_for_some_steps_and_say_why_they_stop(name: str) -> None:
    watched = watch_design(replace(problem(name), steps=5))
    assert watched.faults == ()
    if watched.result is None:
        assert watched.ending.startswith("start: expected a shape with one rest for each of ")
        return
    status = watched.result.status
    reason = "converged" if status is Status.CONVERGED else status.value.partition(";")[0]
    assert watched.ending.startswith(reason)


@pytest.mark.parametrize(
    "name",
    [
        "leans 1e-6 short of tipping, paper with finish",
        "leans on the verge of tipping, paper",
        "center 1e-9 from a facet, exact, vertices",
        "two outcomes of 1e-6, searched, exact",
        "60 facets, fair, exact",
    ],
)
def test_some_more_converge(name: str) -> None:
    design = problem(name)
    watched = watch_design(design)
    assert watched.faults == ()
    assert watched.ending.startswith("converged")
    assert watched.error <= design.tolerance


def test_where_no_step_is_left_the_reason_says_so() -> None:
    """A centroid is too far from three facets of a tetrahedron for such odds."""
    watched = watch_design(problem("one outcome of 0.97"))
    assert watched.faults == ()
    assert watched.result is not None
    assert watched.result.status in (Status.NO_PROGRESS, Status.STEP_LIMIT)
    assert watched.error > 0.01
    assert watched.ending.startswith(watched.result.status.value.partition(";")[0])


@pytest.mark.parametrize("depth", [1e-3, 1e-12, 0.0, -1e-3, -1e-12])
def test_the_leaning_box_is_as_near_to_tipping_as_it_says(depth: float) -> None:
    design = leaning(depth)
    points = design.start.points
    bottom = points[points[:, 2] < 0.0]
    # The middle of a parallelepiped is that of its corners, here the origin.
    assert float(-bottom[:, 0].min()) == pytest.approx(1.0 - depth, abs=1e-15)
    assert float(bottom[:, 0].max()) == pytest.approx(depth, abs=1e-16)


@pytest.mark.parametrize("distance", [1e-3, 1e-12])
def test_the_given_center_is_as_near_to_a_facet_as_it_says(distance: float) -> None:
    design = near_facet(distance)
    equations = QhullHull(design.start.points).equations
    nearest = -(equations[:, :3] @ design.center_of_mass + equations[:, 3]).max()
    assert nearest == pytest.approx(distance, abs=1e-15)


@pytest.mark.parametrize("angle", [1e-3, 1e-8])
def test_two_facets_include_the_angle_they_should(angle: float) -> None:
    a, b = coincident(angle).start.directions[:2]
    assert np.sqrt(((a - b) ** 2).sum()) == pytest.approx(angle, rel=1e-6)


def test_maxima_that_cancel_give_a_bounded_gradient() -> None:
    """On this cube the maxima around each face's opposite pair cancel in pairs."""
    design = loaded_box()
    corners = torch.tensor(design.start.points, requires_grad=True)
    rests = evaluate_rests(corners)
    # Opposite faces in one cluster: the maxima on its border are all eight corners.
    halves = cluster(rests.hull.normals[rests.paths.rests], design.start.directions[::2])
    pairs = np.argmax(np.abs(rests.hull.normals[rests.paths.rests]), axis=1)
    state = ClusteredRests(rests, replace(halves, of_rest=pairs), design.target)
    energy = barycenter_energy(state, EnergyWeights())
    (gradient,) = torch.autograd.grad(energy, corners)
    assert torch.isfinite(gradient).all()
    assert float(gradient.abs().max()) < 1e5
    # A barycenter of length 0 is at distance 1 from every normal.
    assert float(energy.detach()) == pytest.approx(6.0, abs=1e-9)


def test_stability_does_not_jump_where_two_parts_of_a_facet_change_places() -> None:
    """A cube whose top is broken along a diagonal. The direction of its outcome crosses from the
    normal of one part to that of the other; then the center of mass does, from below one to below
    the other, which are equally deep where it crosses."""
    points = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
    points[(points == [-1.0, -1.0, 1.0]).all(axis=1), 2] += 1e-2
    points[(points == [1.0, 1.0, 1.0]).all(axis=1), 2] += 1e-2

    def energy(tilt: float, shift: float) -> float:
        rests = evaluate_rests(
            torch.tensor(points), torch.tensor([shift, -shift, 0.1], dtype=torch.float64)
        )
        directions = np.array([[tilt, -tilt, 1.0], [1.0, 0.0, 0.0]])
        clusters = cluster(rests.hull.normals[rests.paths.rests], directions)
        state = ClusteredRests(rests, clusters, np.full(2, 0.5))
        return float(stability_energy(state, EnergyWeights(stability_margin=0.05)))

    for shift in (0.02, -0.02):
        assert energy(1e-9, shift) == pytest.approx(energy(-1e-9, shift), abs=1e-6)
    values = [energy(0.0, shift) for shift in (-1e-7, -1e-9, 1e-9, 1e-7)]
    for before, after in pairwise(values):
        assert before == pytest.approx(after, abs=1e-4)
    assert energy(0.0, 0.02) < values[0] - 0.1


class Cliff:
    """Falls by 1 over a width of 1e-12, as near a glancing crossing, on a gentle slope."""

    directions = np.eye(3)
    flaws = 0

    def __init__(self, x: float) -> None:
        self.parameters = np.array([x])
        self.objective = self

    def attempt(self, parameters: np.ndarray, directions: np.ndarray) -> Cliff:
        return Cliff(float(parameters[0]))

    @property
    def value(self) -> float:
        x = float(self.parameters[0])
        return 2.0 + 0.1 * x + 0.5 * np.tanh(1e12 * x)

    @cached_property
    def gradient(self) -> np.ndarray:
        x = float(self.parameters[0])
        return np.array([0.1 + 0.5e12 / np.cosh(min(1e12 * abs(x), 300.0)) ** 2])


def test_a_large_gradient_is_damped_to_a_step_of_ordinary_length() -> None:
    cliff = Cliff(0.0)
    assert cliff.gradient[0] > 1e11
    end = LineSearch().search(cliff, cliff.gradient)
    assert end is not None
    assert 1e-4 < -end.parameters[0] <= 0.1
    assert end.value < 1.6


@pytest.mark.parametrize("size", [1e101, 1e300, np.inf, np.nan])
def test_a_gradient_beyond_use_gives_no_step_and_no_warning(size: float) -> None:
    assert LineSearch().search(Cliff(0.0), np.array([size])) is None


def test_a_gradient_that_is_no_number_is_given_as_the_reason(monkeypatch) -> None:
    monkeypatch.setattr(Evaluation, "gradient", np.full(24, np.nan))
    start = repulsion(6, 0)
    options = PaperOptions(step="line_search", finish="none", perturbation=0.0)
    result = descend_as_paper(start, fair(6).probabilities, options)
    unreachable = listed([0.3, *[0.14] * 5]).probabilities
    stuck = descend_as_paper(start, unreachable, options)
    assert result.status is Status.CONVERGED
    assert stuck.status is Status.NO_GRADIENT
    assert "no finite gradient" in stuck.status.value
    assert np.isfinite(stuck.history[-1].energy)


def test_a_start_whose_odds_cannot_be_told_is_shaken() -> None:
    design = problem("balances on a corner")
    center = design.center_of_mass
    coordinates, parameters = VertexCoordinates.of(design.start.points, center)
    objective = Objective(coordinates, design.target, EnergyWeights(), center)
    with pytest.raises(DegenerateBodyError):
        _ = objective.evaluate(parameters, design.start.directions).value
    shaken = objective.first(parameters, design.start.directions, perturbation=0.0, seed=0)
    vertices = shaken.rests.hull.vertices
    moved = np.abs(vertices[:, None] - design.start.points[None]).max(-1).min(1).max()
    assert 1e-7 < moved < 1e-4


def test_the_suite_has_every_design_as_a_row_with_its_ending() -> None:
    names = {case.name for case in stability_cases()}
    assert {f"design: {name}" for name in CASES} <= names
    row = run_case(("design: needle 2:1, exact", 0))
    assert (row.verdict, row.size, row.rests) == (OK, 6, 6)
    assert row.ending.startswith("converged, max |p - q| ")
    assert row.line().endswith(f"  ok  ({row.ending})")
    assert row.error is not None
    assert row.error < 1e-14


def test_the_suite_loads_torch_for_its_designs_only() -> None:
    script = (
        "import sys\n"
        "from dicedesign.bench.benches.stability import run_case\n"
        "run_case(('cube', 0))\n"
        "assert 'torch' not in sys.modules\n"
        "run_case(('design: symmetric prism', 0))\n"
        "assert 'torch' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_every_stiff_body_is_a_start_with_a_finite_gradient() -> None:
    """Nearly flat facets, balances on edges and corners, glancing crossings, needles."""
    options = PaperOptions(step="line_search", perturbation=0.0, steps=0, finish="none")
    seen: list[Evaluation] = []
    for case in stability_cases():
        body = case.build() if case.quick and case.turns == case.points == 0 else None
        if not isinstance(body, Problem):
            continue
        poses = rest_poses(body.points, body.center)
        outcomes = len(poses.normals)
        if outcomes < 2:
            continue
        descend_as_paper(
            Start(body.points, poses.normals),
            np.linspace(1.0, 2.0, outcomes) / (1.5 * outcomes),
            options,
            center_of_mass=body.center,
            on_evaluation=seen.append,
        )
        last = seen[-1]
        assert step_faults(last.rests, last.gradient, last.values) == [], case.name
    assert len(seen) > 100
    # Near events they are large.
    assert max(np.abs(evaluation.gradient).max() for evaluation in seen) > 1e6
