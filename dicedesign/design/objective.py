"""The function that a design minimises, evaluated at one set of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.coordinates import Coordinates
from dicedesign.design.differentiable import RestEvaluation, evaluate_rests
from dicedesign.design.energy import (
    Clusters,
    EnergyWeights,
    cluster,
    total_energy,
    updated_directions,
)
from dicedesign.errors import DiceError
from dicedesign.geometry.hull_reuse import HullMemory

__all__ = ["Evaluation", "Objective"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Objective:
    """Energy of eq. 16 as a function of coordinates.

    Attributes
    ----------
    coordinates: how parameters make a shape.
    target: (k,) wanted probabilities.
    weights: of the regularizers.
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
        leaf = torch.tensor(parameters, requires_grad=True)
        center = None
        if self.center_of_mass is not None:
            center = torch.as_tensor(self.center_of_mass)
        points = self.coordinates.points(leaf, self.polars.hull)
        rests = evaluate_rests(points, center, self.shapes.hull)
        return Evaluation(self, leaf, rests, directions)

    def attempt(self, parameters: Floats, directions: Floats) -> Evaluation | None:
        """`evaluate`, or None where that fails or the energy is not finite."""
        try:
            evaluation = self.evaluate(parameters, directions)
            return evaluation if np.isfinite(evaluation.value) else None
        except (DiceError, torch.linalg.LinAlgError):
            return None


@dataclass(frozen=True)
class Evaluation:
    """One evaluation of an objective. Everything is computed on first use."""

    objective: Objective
    leaf: Tensor
    rests: RestEvaluation
    directions: Floats

    @property
    def parameters(self) -> Floats:
        """The flat parameters of this evaluation."""
        return self.leaf.detach().numpy()

    @cached_property
    def clusters(self) -> Clusters:
        """Which outcome each rest counts for."""
        return cluster(self._rest_normals, self.directions)

    @cached_property
    def terms(self) -> dict[str, Tensor]:
        """The weighted terms of the energy by name."""
        objective = self.objective
        return total_energy(self.rests, self.clusters, objective.target, objective.weights)

    @cached_property
    def values(self) -> dict[str, float]:
        """The weighted terms of the energy by name, as numbers."""
        return {name: float(term.detach()) for name, term in self.terms.items()}

    @cached_property
    def value(self) -> float:
        """The energy."""
        return sum(self.values.values())

    @cached_property
    def gradient(self) -> Floats:
        """Gradient of the energy with respect to the flat parameters."""
        total = torch.stack(list(self.terms.values())).sum()
        return torch.autograd.grad(total, self.leaf, retain_graph=True)[0].numpy()

    @cached_property
    def error(self) -> float:
        """Largest |p - q| over the clusters."""
        sums = self.clusters.sums(self.rests.probabilities.detach()).numpy()
        return float(np.abs(sums - self.objective.target).max())

    @cached_property
    def flaws(self) -> int:
        """Outcomes without a rest, and under the stability term also rests too many."""
        outcomes, empty = len(self.directions), self.clusters.empty
        if self.objective.weights.stability == 0.0:
            return empty
        return empty + len(self.clusters.of_rest) - (outcomes - empty)

    @property
    def _rest_normals(self) -> Floats:
        return self.rests.hull.normals[self.rests.paths.rests]

    def refreshed(self) -> Evaluation:
        """The same shape with each outcome's direction moved to the mean of its rests' normals."""
        directions = updated_directions(self._rest_normals, self.clusters)
        return Evaluation(self.objective, self.leaf, self.rests, directions)

    def under(self, objective: Objective) -> Evaluation:
        """The same shape under another objective with the same coordinates and center of mass."""
        return Evaluation(objective, self.leaf, self.rests, self.directions)
