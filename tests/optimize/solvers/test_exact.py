"""The exact method: probabilities as wanted to rounding, one flat rest for each outcome, other
priors."""

from __future__ import annotations

from dataclasses import replace
from itertools import count, product
from typing import Any

import numpy as np
import pytest
import torch
from common.kernels import slow_machine

import dicedesign as dd
from dicedesign.errors import NoStartError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.coordinates import FacetCoordinates
from dicedesign.optimize.options import ExactOptions, SobolevOptions
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.candidate import CandidateMaker, DesignResult, DesignStep
from dicedesign.optimize.solvers.exact import largest_jump, solve_exact
from dicedesign.optimize.starts.search import shapes_like, shapes_near
from dicedesign.optimize.starts.shapes import hendecahedron, prism, repulsion
from dicedesign.optimize.starts.start import Start
from dicedesign.optimize.targets import binomial, sum_of_dice
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status
from tests.reference.measurement import OK, measure, verdict
from tests.reference.problem import Problem

torch.set_num_threads(1)

TARGETS = {
    "a coin": [1 / 2, 1 / 2],
    "a loaded die": [1 / 3, 2 / 15, 2 / 15, 2 / 15, 2 / 15, 2 / 15],
    "two dice": sum_of_dice([6, 6]).probabilities.tolist(),
    "three dice": sum_of_dice([6, 6, 6]).probabilities.tolist(),
    "uneven": [0.45, 0.3, 0.15, 0.06, 0.04],
}


def solve(target: list[float], seed: int = 0, **options: Any) -> DesignResult:
    wanted = np.array(target)
    return solve_exact(shapes_near(wanted, seed), wanted, ExactOptions(**options))


def check_exact(result: DesignResult, target: np.ndarray, tolerance: float = 1e-12) -> None:
    """Check a result by the forward model, which shares no code with the solver, and the oracle."""
    assert result.status is Status.CONVERGED
    poses = rest_poses(result.hull.vertices)
    assert len(poses.normals) == len(target)
    outcome = np.argmax(poses.normals @ result.directions.T, axis=1)
    assert sorted(outcome) == list(range(len(target)))
    assert np.abs(poses.probabilities - target[outcome]).max() <= 2.0 * tolerance
    assert verdict(measure(Problem(result.hull.vertices))) == OK


@pytest.mark.parametrize("name", TARGETS)
def test_targets_are_met_to_rounding(name: str) -> None:
    check_exact(solve(TARGETS[name]), np.array(TARGETS[name]))


@pytest.mark.parametrize(
    ("name", "metric"), [("a coin", None), ("two dice", SobolevOptions(0.5, 2))]
)
def test_vertices_meet_targets_too(name: str, metric: SobolevOptions | None) -> None:
    result = solve(TARGETS[name], coordinates="vertices", sobolev=metric)
    check_exact(result, np.array(TARGETS[name]))
    # Nothing keeps four vertices in one plane.
    assert (np.diff(result.hull.facet_start) == 3).all()


@pytest.mark.parametrize(
    ("start", "target"),
    [
        (hendecahedron("bisymmetric"), sum_of_dice([6, 6]).probabilities),
        (prism(5), binomial(4).probabilities),
    ],
)
def test_the_die_stays_similar_to_a_given_start(start: Start, target: np.ndarray) -> None:
    steps: list[DesignStep] = []
    options = ExactOptions(prefer=Preferences())
    result = solve_exact(shapes_like(start, 0), target, options, on_step=steps.append)
    check_exact(result, target)
    # It has no more facets, and those of the outcomes lie nearest to where they were.
    assert len(result.hull.normals) <= len(convex_hull(start.points).normals)
    nearest = np.argmax(result.directions @ start.directions.T, axis=1)
    assert np.mean(nearest == np.arange(len(target))) > 0.5
    # Callbacks receive every accepted step.
    assert tuple(steps) == result.history
    assert [step.step for step in steps] == list(range(len(steps)))
    assert all(step.energy == step.terms["dice"] for step in steps)
    assert result.evaluations >= len(steps)


OUT_OF_REACH = [1.0 - 1e-6, 5e-7, 5e-7]
"""Target with such small probabilities that rests are lost on the way."""


def test_unreachable_targets_end_with_the_best_die() -> None:
    result = solve(OUT_OF_REACH, starts=5)
    assert result.status is Status.NO_START
    assert result.starts == 5
    best = min(step.error for step in result.history)
    assert best > 1e-3
    poses = rest_poses(result.hull.vertices)
    assert len(poses.normals) == 3
    assert max(poses.probabilities) == pytest.approx(OUT_OF_REACH[0] - best, abs=1e-9)
    assert result.error == best
    # One start is tried, however short the time.
    for seconds in (0.05, 1e-9):
        assert solve(OUT_OF_REACH, seconds=seconds).status is Status.TIME_LIMIT
    few = solve(OUT_OF_REACH, evaluations=40)
    assert few.status is Status.STEP_LIMIT
    assert 40 <= few.evaluations < 80


def test_starts_without_a_fixed_center_inside_are_skipped() -> None:
    target, center = np.array([0.4, 0.3, 0.2, 0.1]), np.array([0.05, -0.02, 0.1])
    start = repulsion(4, 0)
    beside = replace(start, points=start.points + 5.0)
    result = solve_exact([beside, start], target, ExactOptions(), center_of_mass=center)
    assert (result.status, result.starts) == (Status.CONVERGED, 2)
    poses = rest_poses(result.hull.vertices, center)
    np.testing.assert_allclose(poses.probabilities, target, atol=2e-12)


def test_a_search_that_finds_no_shape_ends() -> None:
    turns = count()
    with pytest.raises(NoStartError, match="got none; take another start"):
        solve_exact((None for _ in turns), np.array([0.5, 0.5]), ExactOptions())
    # Turns between shapes count as well.
    starts = [*[None] * (next(turns) - 2), repulsion(4, 0)]
    assert solve_exact(starts, np.full(4, 0.25), ExactOptions()).status is Status.CONVERGED


@pytest.mark.parametrize("target", [TARGETS["uneven"], OUT_OF_REACH])
def test_a_slow_machine_makes_the_same_die(target: list[float]) -> None:
    """Though it takes it for months: one that has its probabilities, and one that never gets
    them."""
    usual = solve(target, starts=3)
    with slow_machine():
        slow = solve(target, starts=3)
    assert slow.hull.vertices.tobytes() == usual.hull.vertices.tobytes()
    assert (slow.status, slow.starts) == (usual.status, usual.starts)
    assert slow.history[-1].seconds > 1e6


def test_the_solver_accepts_a_prior_as_text() -> None:
    cube = np.array(list(product((-1.0, 1.0), repeat=3)))
    start, target = Start(cube, rest_poses(cube).normals), np.array([0.3, *[0.14] * 5])
    result = solve_exact([start], target, ExactOptions(), prior="vmf:0,0,1:1")
    assert result.status is Status.CONVERGED
    poses = rest_poses(result.hull.vertices).under("vmf:0,0,1:1")
    nearest = np.argmax(result.directions @ poses.normals.T, axis=1)
    np.testing.assert_allclose(poses.probabilities[nearest], target, atol=1e-12)


PRIOR = dd.VonMisesFisher([0.2, 0.1, -1.0], 2.0)
WEDGE = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0], [-1, 0, 2], [2, 0, 2.0]])
WEDGE = np.concatenate([WEDGE, WEDGE[4:] + np.array([0, 1, 0])])


@pytest.mark.parametrize(("aside", "jumps"), [(0.3, False), (1e-9, True)])
def test_probabilities_jump_with_a_center_of_mass_over_an_edge(aside: float, jumps: bool) -> None:
    center = np.array([aside, 0.5, 0.9])
    poses = dd.rest_poses(WEDGE, center).under(PRIOR)
    coordinates, parameters = FacetCoordinates.of(WEDGE, center)
    candidate = CandidateMaker(center).attempt(coordinates, parameters, poses.normals)
    assert candidate is not None
    jump = largest_jump(candidate, poses.probabilities, PRIOR)
    assert jump > 1e-3 if jumps else jump < 1e-6
