"""The function that a design minimises, evaluated at one set of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
import torch

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import HullMemory
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.optimize.coordinates.shape import Coordinates, Shape
from dicedesign.optimize.energy.clusters import (
    ClusteredRests,
    Clusters,
    cluster,
    updated_directions,
)
from dicedesign.optimize.energy.energy import Energy
from dicedesign.optimize.energy.term import EnergyWeights
from dicedesign.runtime.arrays import Floats

__all__ = ["Evaluation", "Objective"]

SHAKE: Final = 1e-6
"""Least perturbation of a start that balances exactly, so that its basins cannot be told."""


@dataclass(frozen=True)
class Objective:
    """Energy of eq. 16 as a function of coordinates.

    Attributes
    ----------
    coordinates: how parameters make a shape.
    target: (k,) wanted probabilities.
    weights: of the energy's terms.
    center_of_mass: (3,) fixed, or None for that of the uniform solid.
    shapes: the hulls of the last evaluation and how many there were.
    polars: the same for the hulls that the coordinates need to make a shape.
    """

    coordinates: Coordinates
    target: Floats
    weights: EnergyWeights
    center_of_mass: Floats | None
    shapes: HullMemory = field(default_factory=HullMemory, repr=False, compare=False)
    polars: HullMemory = field(default_factory=HullMemory, repr=False, compare=False)

    def evaluate(self, parameters: Floats, directions: Floats) -> Evaluation:
        """Hull, rests and energy at flat parameters, for outcome directions (k, 3).

        Raises DiceError where the parameters make no solid with c inside.
        """
        center = None
        if self.center_of_mass is not None:
            center = torch.as_tensor(self.center_of_mass)
        shape = self.coordinates.shape(parameters, self.polars.hull)
        points = torch.from_numpy(shape.points).requires_grad_()
        rests = evaluate_rests(points, center, self.shapes.hull)
        return Evaluation(self, parameters, shape, rests, directions)

    def first(
        self, parameters: Floats, directions: Floats, perturbation: float, seed: int
    ) -> Evaluation:
        """The evaluation that a descent begins with: at parameters (n,) that are shaken by normal
        noise of a standard deviation, which is at least `SHAKE` where the odds cannot be told, and
        less where so much leaves no solid with the center inside.

        Raises as `evaluate`.
        """
        noise = np.random.default_rng(seed).normal(size=parameters.shape)
        if perturbation < SHAKE:
            still = self.attempt(parameters + perturbation * noise, directions)
            if still is not None:
                return still.refreshed()
            perturbation = SHAKE
        while perturbation > 2.0 * SHAKE:
            shaken = self.attempt(parameters + perturbation * noise, directions)
            if shaken is not None:
                return shaken.refreshed()
            perturbation /= 2.0
        return self.evaluate(parameters + perturbation * noise, directions).refreshed()

    def attempt(self, parameters: Floats, directions: Floats) -> Evaluation | None:
        """`evaluate`, or None where that fails or the energy is not finite."""
        try:
            evaluation = self.evaluate(parameters, directions)
            return evaluation if np.isfinite(evaluation.value) else None
        except (DiceError, np.linalg.LinAlgError):
            return None


@dataclass(frozen=True)
class Evaluation:
    """One evaluation of an objective. Everything is computed on first use."""

    objective: Objective
    parameters: Floats
    shape: Shape
    rests: RestEvaluation
    directions: Floats

    @cached_property
    def clusters(self) -> Clusters:
        """Outcome for which each rest counts."""
        return cluster(self._rest_normals, self.directions)

    @cached_property
    def energy(self) -> Energy:
        """The energy's terms and its gradient in the vertices."""
        state = ClusteredRests(self.rests, self.clusters, self.objective.target)
        return Energy(state, self.objective.weights)

    @property
    def values(self) -> dict[str, float]:
        """The weighted terms of the energy by name."""
        return self.energy.terms

    @cached_property
    def value(self) -> float:
        """The energy."""
        return sum(self.values.values())

    @cached_property
    def gradient(self) -> Floats:
        """Gradient of the energy with respect to the flat parameters."""
        rows = self.energy.gradient.reshape(1, -1)
        return self.shape.in_parameters(rows, self.rests.hull.source)[0]

    @cached_property
    def error(self) -> float:
        """Largest |p - q| over the clusters."""
        target = self.objective.target
        sums = np.bincount(self.clusters.of_rest, self.rests.odds, minlength=len(target))
        return float(np.abs(sums - target).max())

    @cached_property
    def flaws(self) -> int:
        """Outcomes without a rest, and under a term that wants single rests also rests too many."""
        outcomes, empty = len(self.directions), self.clusters.empty
        if not self.objective.weights.single_rests:
            return empty
        return empty + len(self.clusters.of_rest) - (outcomes - empty)

    @property
    def _rest_normals(self) -> Floats:
        return self.rests.hull.normals[self.rests.paths.rests]

    def refreshed(self) -> Evaluation:
        """The same shape with each outcome's direction moved to the mean of its rests' normals."""
        directions = updated_directions(self._rest_normals, self.clusters)
        return replace(self, directions=directions)

    def under(self, objective: Objective) -> Evaluation:
        """The same shape under another objective with the same coordinates and center of mass."""
        return replace(self, objective=objective)
