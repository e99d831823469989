"""A die of the exact method, at one set of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.coordinates import Coordinates
from dicedesign.design.differentiable import RestEvaluation, evaluate_rests
from dicedesign.errors import DiceError
from dicedesign.geometry.hull_reuse import HullMemory
from dicedesign.rest.equilibria import Tie

__all__ = ["Trial", "TrialMaker"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Trial:
    """A die with one rest for each outcome and no other.

    Attributes
    ----------
    coordinates: what its parameters mean.
    leaf: (n,) the parameters, which gradients are taken of.
    rests: the die.
    rest_of_outcome: (k,) index into the die's rests of each outcome.
    """

    coordinates: Coordinates
    leaf: Tensor
    rests: RestEvaluation
    rest_of_outcome: Integers

    @property
    def parameters(self) -> Floats:
        """(n,) the parameters."""
        return self.leaf.detach().numpy()

    @property
    def outcome_facets(self) -> Integers:
        """(k,) facet of each outcome."""
        return self.rests.paths.rests[self.rest_of_outcome]

    @property
    def directions(self) -> Floats:
        """(k, 3) normals of those facets."""
        return self.rests.hull.normals[self.outcome_facets]

    @property
    def odds(self) -> Tensor:
        """(k,) probabilities of the outcomes."""
        return self.rests.probabilities[torch.as_tensor(self.rest_of_outcome)]

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) the same as numbers."""
        return self.odds.detach().numpy()

    @cached_property
    def depths(self) -> Tensor:
        """(m,) how surely each facet is what it is, a rest or none: its depth
        (`RestEvaluation.facet_depths`), with the other sign for facets that are no rests."""
        sign = np.full(len(self.rests.hull.normals), -1.0)
        sign[self.outcome_facets] = 1.0
        return torch.as_tensor(sign) * self.rests.facet_depths

    def error(self, target: Floats) -> float:
        """Largest |p - q| for target probabilities (k,)."""
        return float(np.abs(self.probabilities - target).max())

    def jacobian(self, values: Tensor) -> Floats:
        """(r, n) derivatives of values (r,) in the parameters, in one batched backward pass."""
        (jacobian,) = torch.autograd.grad(
            values,
            self.leaf,
            grad_outputs=torch.eye(len(values), dtype=torch.float64),
            is_grads_batched=True,
            retain_graph=True,
        )
        return jacobian.numpy()


@dataclass
class TrialMaker:
    """Makes trials, and remembers the hulls of the last ones.

    Attributes
    ----------
    center_of_mass: (3,) fixed, or None for that of the uniform solid.
    evaluations: how many trials were asked for.
    shapes, polars: memories of the hulls of dice, and of those that coordinates need.
    """

    center_of_mass: Floats | None
    evaluations: int = 0
    shapes: HullMemory = field(default_factory=HullMemory)
    polars: HullMemory = field(default_factory=HullMemory)

    def attempt(
        self, coordinates: Coordinates, parameters: Floats, directions: Floats
    ) -> Trial | None:
        """A trial, or None where the parameters make no die with the wanted rests, or one that is
        tied: the odds of a tied body jump.

        parameters: (n,) of the coordinates; directions: (k, 3) near which each outcome's facet is.
        """
        self.evaluations += 1
        leaf = torch.tensor(parameters, requires_grad=True)
        given = self.center_of_mass
        center = None if given is None else torch.as_tensor(given)
        try:
            points = coordinates.points(leaf, self.polars.hull)
            rests = evaluate_rests(points, center, self.shapes.hull).untied()
            stable = rests.hull.normals[rests.equilibria.stable]
            nearest = np.argmax(directions @ stable.T, axis=1)
            if not np.array_equal(np.sort(nearest), np.arange(len(stable))):
                return None
            trial = Trial(coordinates, leaf, rests, nearest)
            return trial if np.isfinite(trial.probabilities).all() else None
        except (DiceError, Tie, torch.linalg.LinAlgError):
            return None
