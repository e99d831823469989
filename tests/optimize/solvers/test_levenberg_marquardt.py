"""One step towards wanted odds against the same step by a dense solver of its conditions."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.optimize.coordinates.facets import Coordinates, FacetCoordinates, VertexCoordinates
from dicedesign.optimize.solvers.candidate import Candidate, CandidateMaker
from dicedesign.optimize.solvers.levenberg_marquardt import LevenbergMarquardt
from dicedesign.optimize.solvers.sobolev import SobolevOptions, graph_laplacian
from dicedesign.rest.poses import rest_poses

torch.set_num_threads(1)


def first_candidate(vertices: bool) -> tuple[CandidateMaker, Candidate]:
    points = np.random.default_rng(5).normal(size=(9, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    center = convex_hull(points).centroid
    coordinates: Coordinates
    if vertices:
        coordinates, parameters = VertexCoordinates.of(points, center)
    else:
        coordinates, parameters = FacetCoordinates.of(points, center)
    maker = CandidateMaker(None)
    candidate = maker.attempt(coordinates, parameters, rest_poses(points).normals)
    assert candidate is not None
    return maker, candidate


@pytest.mark.parametrize("options", [None, SobolevOptions(1.5, 1), SobolevOptions(0.7, 2)])
def test_a_step_is_the_shortest_in_its_metric(options: SobolevOptions | None) -> None:
    """With little damping it is the s of least s^T W s among those with J s = q - p."""
    maker, candidate = first_candidate(vertices=True)
    shift = 2e-4 * np.cos(np.arange(len(candidate.odds)))
    target = candidate.odds + shift - shift.mean()
    candidates: list[Candidate] = []
    approach = LevenbergMarquardt(
        target, maker, options, 1e-13, lambda: len(candidates) > 1, candidates.append
    )
    approach.solve(candidate)
    step = candidates[1].parameters - candidate.parameters

    odds = candidate.jacobian(candidate.rests.probabilities[candidate.rest_of_outcome])
    hull = candidate.rests.hull
    metric = np.eye(odds.shape[1])
    if options is not None:
        laplacian = graph_laplacian(hull).toarray()
        one = np.eye(len(laplacian)) + options.smoothing * laplacian
        metric = np.kron(np.linalg.matrix_power(one, options.power), np.eye(3))
    # Odds sum to 1, so that the last row says nothing new.
    rows, misses = odds[:-1], (target - candidate.odds)[:-1]
    zeros = np.zeros((len(rows), len(rows)))
    conditions = np.block([[metric, rows.T], [rows, zeros]])
    shortest = np.linalg.solve(conditions, np.concatenate([np.zeros(len(metric)), misses]))
    shortest = shortest[: len(metric)]
    # The first damping is a thousandth.
    assert np.linalg.norm(step - shortest) <= 0.02 * np.linalg.norm(shortest)


@pytest.mark.parametrize("vertices", [False, True])
def test_a_near_target_is_met_in_few_steps(vertices: bool) -> None:
    maker, candidate = first_candidate(vertices)
    shift = 1e-3 * np.sin(1.0 + np.arange(len(candidate.odds)))
    target = candidate.odds + shift - shift.mean()
    candidates: list[Candidate] = []
    end = LevenbergMarquardt(target, maker, None, 1e-13, lambda: False, candidates.append).solve(
        candidate
    )
    assert end is candidates[-1]
    assert end.error(target) <= 1e-13
    assert len(candidates) <= 20
    assert end.dice_energy(target) <= 1e-25


def test_a_die_within_the_tolerance_stays_as_it_is() -> None:
    maker, candidate = first_candidate(vertices=False)
    approach = LevenbergMarquardt(
        candidate.odds, maker, None, 1e-13, lambda: False, lambda candidate: None
    )
    assert approach.solve(candidate) is candidate
