"""The momentum model: probabilities of a thrown die from its Morse-Smale complex.

A die that hits the table with much energy is in each basin with the probability of its area. Every
impact takes energy and lets the die leave its basin over a saddle, the less often the higher the
saddle is above the rest relative to the remaining energy, a temperature that falls from impact to
impact. A die that passes a saddle with enough speed may be carried over the next one at once. The
rates of both depend on the features of `dicedesign.throws.transition_features`, by two small
networks fitted to simulated throws of random dice. The table changes the temperature, and is a
further input of the networks.

Written once, for NumPy and torch; a compiled kernel replaces it for NumPy.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.triangles import Surface
from dicedesign.kernels import ops as kernels
from dicedesign.rest.morse import Separatrices
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.momentum_model import (
    CARRIES,
    IMPACTS,
    MAX_LOG_RATE,
    MAX_LOG_STRETCH,
    NO_BARRIER,
    MomentumMixture,
    MomentumModel,
    momentum_model,
)
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.transition_features import Features, Transitions, body_features
from dicedesign.tolerances import ROUNDING


def landing_probabilities(
    features: Features, transitions: Transitions, model: MomentumModel, xp: ModuleType
) -> Any:
    """Probabilities (k,) of the rests of a thrown body, nonnegative and with the sum of the
    probabilities without momentum.

    model: its constants may be (m,), one for each transition, and its biases and shifts (m, o) and
        (t, o), if the body is a batch of independent bodies, each on its own table.
    """
    rests, ways = transitions.rests, len(transitions.source)
    if ways == 0:
        return features.probabilities
    source, target = xp.asarray(transitions.source), xp.asarray(transitions.target)
    first, second = xp.asarray(transitions.first), xp.asarray(transitions.second)
    time = 0.5 - (np.arange(IMPACTS) + 0.5) / IMPACTS
    terms = xp.asarray(np.stack([np.ones(IMPACTS), time, time**2 - 0.08]))
    known = features.barriers
    times = xp.asarray(time)[:, None] - 0.5
    temperature = xp.exp(model.hot + model.cooling * times + 0.0 * known)
    going = model.transitions(features.transitions, xp)
    going_on = model.carries(features.carries, xp)
    stretch = xp.exp(MAX_LOG_STRETCH * xp.tanh(going[:, 3] / MAX_LOG_STRETCH))
    # Rounding may make a barrier of no height negative.
    barriers = xp.where(known > ROUNDING, known, ROUNDING)
    free = -xp.log(-xp.expm1(-barriers / NO_BARRIER))
    rates = _bounded_exp((going[:, :3] @ terms).T - stretch * known / temperature + free, xp)
    barred = (model.carry_barrier / temperature)[:, first]
    weights = _bounded_exp((going_on @ terms).T - barred * features.exits, xp)
    probabilities = features.probabilities
    for rate, weight in zip(rates, weights, strict=True):
        leaving = _sums(rate, source, rests)
        # A rest without transitions is never left.
        share = -xp.expm1(-leaving) / (leaving + 1e-300)
        gone = probabilities * share
        flow = gone[source] * rate
        probabilities = probabilities - gone * leaving
        stays = 1.0 / (1.0 + _sums(weight, first, ways))
        carried = weight * stays[first]
        for _ in range(CARRIES):
            probabilities = probabilities + _sums(flow * stays, target, rests)
            flow = _sums(flow[first] * carried, second, ways)
        probabilities = probabilities + _sums(flow, target, rests)
    return probabilities


def _bounded_exp(logarithm: Any, xp: ModuleType) -> Any:
    """Exponential of a logarithm that is smoothly bounded by `MAX_LOG_RATE`."""
    return xp.exp(-xp.logaddexp(-logarithm, 0.0 * logarithm - MAX_LOG_RATE))


def _sums(values: Any, index: Any, count: int) -> Any:
    """(count,) sums of values by index."""
    if isinstance(values, np.ndarray):
        return np.bincount(index, values, count)
    return values.new_zeros(count).index_add(0, index, values)


def hull_probabilities(
    hull: ConvexHull,
    paths: Separatrices,
    center: Floats,
    inertia: Floats,
    probabilities: Floats,
    model: MomentumModel,
) -> Floats:
    """Probabilities (k,) of a thrown body's rests, in the order of `paths.rests`.

    center: (3,) center of mass; inertia: (3, 3) tensor of inertia about it per mass, in the squared
    unit of length; probabilities: (k,) without momentum; model: in NumPy.
    """
    thrown = kernels.throw_probabilities(hull, paths, model, center, inertia, probabilities)
    if thrown is None:
        transitions = Transitions.of(hull, paths)
        features = body_features(transitions, hull.vertices, center, inertia, probabilities, np)
        thrown = landing_probabilities(features, transitions, model, np)
    return thrown


def mixture_probabilities(
    hull: ConvexHull,
    paths: Separatrices,
    center: Floats,
    inertia: Floats,
    probabilities: Floats,
    mixture: MomentumMixture,
) -> Floats:
    """Probabilities (k,) of a body's rests on a mixture of tables; see `hull_probabilities`."""
    known = hull, paths, center, inertia, probabilities
    thrown = [hull_probabilities(*known, model) for model in mixture.models]
    mean: Floats = mixture.weights @ np.array(thrown)
    return mean


def throw_probabilities(
    points_or_mesh: ArrayLike | Body | Surface,
    poses: RestPoses | None = None,
    table: str = "board-game",
) -> Floats:
    """Probabilities (k,) of the rests of a body that is thrown onto a table, by the momentum model
    and with the inertia of `rigid_body`.

    points_or_mesh, poses: as for `rigid_body`; the rests are in their order. table: its name, or
    the path of its .json file. Raises InputError as `momentum_model`, or for rests under a prior.
    """
    body = body_of(points_or_mesh)
    poses = poses or rest_poses(body)
    return momentum_probabilities(poses, rigid_body(body, poses), momentum_model(table))


def momentum_probabilities(
    poses: RestPoses, body: RigidBody, mixture: MomentumMixture | None
) -> Floats:
    """Probabilities (k,) of a thrown body's rests, see `thrown_probabilities`."""
    return thrown_probabilities(poses, body.inertia, mixture)


def thrown_probabilities(
    poses: RestPoses, inertia: Floats, mixture: MomentumMixture | None
) -> Floats:
    """Probabilities (k,) of a thrown body's rests, in the order of `poses`.

    For a body that balances within rounding they are the mean of both sides, as in `poses`.
    inertia: (3, 3) tensor about the center of mass per mass, in the squared unit of length. Raises
    InputError for rests under a prior.
    """
    if poses.prior is not None:
        raise InputError(
            "poses: expected rests under a uniform prior, as of a thrown body, got rests under "
            "another prior; take poses.under(None)"
        )
    if mixture is None or len(poses.facets) == 1:
        return poses.probabilities
    # The model was learned from bodies with flat facets.
    sides = poses.with_flat_facets().basins
    of_sides = []
    for side in sides:
        hull, center = side.equilibria.hull, side.equilibria.center_of_mass
        probabilities = side.areas / (4.0 * math.pi)
        known = hull, side.paths, center, inertia, probabilities
        of_sides.append(mixture_probabilities(*known, mixture))
    return poses.mean_of_sides(sides, of_sides)
