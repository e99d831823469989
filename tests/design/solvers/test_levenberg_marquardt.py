"""One step towards wanted odds against the same step by a dense solver of its conditions."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dicedesign.design.coordinates.facets import FacetCoordinates
from dicedesign.design.coordinates.shape import Coordinates
from dicedesign.design.coordinates.vertices import VertexCoordinates
from dicedesign.design.solvers.candidate import Trial, TrialMaker
from dicedesign.design.solvers.levenberg_marquardt import Approach, dice_energy
from dicedesign.design.solvers.sobolev import SobolevOptions, graph_laplacian
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.poses import rest_poses

torch.set_num_threads(1)


def first_trial(vertices: bool) -> tuple[TrialMaker, Trial]:
    points = np.random.default_rng(5).normal(size=(9, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    center = convex_hull(points).centroid
    coordinates: Coordinates
    if vertices:
        coordinates, parameters = VertexCoordinates.of(points, center)
    else:
        coordinates, parameters = FacetCoordinates.of(points, center)
    maker = TrialMaker(None)
    trial = maker.attempt(coordinates, parameters, rest_poses(points).normals)
    assert trial is not None
    return maker, trial


@pytest.mark.parametrize("options", [None, SobolevOptions(1.5, 1), SobolevOptions(0.7, 2)])
def test_a_step_is_the_shortest_in_its_metric(options: SobolevOptions | None) -> None:
    """With little damping it is the s of least s^T W s among those with J s = q - p."""
    maker, trial = first_trial(vertices=True)
    shift = 2e-4 * np.cos(np.arange(len(trial.odds)))
    target = trial.odds + shift - shift.mean()
    trials: list[Trial] = []
    approach = Approach(target, maker, options, 1e-13, lambda: len(trials) > 1, trials.append)
    approach.end(trial)
    step = trials[1].parameters - trial.parameters

    odds = trial.jacobian(trial.rests.probabilities[trial.rest_of_outcome])
    hull = trial.rests.hull
    metric = np.eye(odds.shape[1])
    if options is not None:
        laplacian = graph_laplacian(hull).toarray()
        one = np.eye(len(laplacian)) + options.smoothing * laplacian
        metric = np.kron(np.linalg.matrix_power(one, options.power), np.eye(3))
    # Odds sum to 1, so that the last row says nothing new.
    rows, misses = odds[:-1], (target - trial.odds)[:-1]
    zeros = np.zeros((len(rows), len(rows)))
    conditions = np.block([[metric, rows.T], [rows, zeros]])
    shortest = np.linalg.solve(conditions, np.concatenate([np.zeros(len(metric)), misses]))
    shortest = shortest[: len(metric)]
    # The first damping is a thousandth.
    assert np.linalg.norm(step - shortest) <= 0.02 * np.linalg.norm(shortest)


@pytest.mark.parametrize("vertices", [False, True])
def test_a_near_target_is_met_in_few_steps(vertices: bool) -> None:
    maker, trial = first_trial(vertices)
    shift = 1e-3 * np.sin(1.0 + np.arange(len(trial.odds)))
    target = trial.odds + shift - shift.mean()
    trials: list[Trial] = []
    end = Approach(target, maker, None, 1e-13, lambda: False, trials.append).end(trial)
    assert end is trials[-1]
    assert end.error(target) <= 1e-13
    assert len(trials) <= 20
    assert dice_energy(end, target) <= 1e-25


def test_a_die_within_the_tolerance_stays_as_it_is() -> None:
    maker, trial = first_trial(vertices=False)
    approach = Approach(trial.odds, maker, None, 1e-13, lambda: False, lambda trial: None)
    assert approach.end(trial) is trial
