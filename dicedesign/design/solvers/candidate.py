"""A die of the exact method, at one set of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from dicedesign.design.coordinates.shape import Coordinates, Shape
from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.reuse import HullMemory
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.gradient.thrown_odds import ThrownOdds
from dicedesign.rest.equilibria import Tie
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["Trial", "TrialMaker"]


@dataclass(frozen=True)
class Trial:
    """A die with one rest for each outcome and no other.

    Attributes
    ----------
    coordinates: what its parameters mean.
    parameters: (n,).
    shape: what they make.
    rests: the die.
    rest_of_outcome: (k,) index into the die's rests of each outcome.
    thrown: the model of its odds when thrown, or None where they are those without momentum.
    """

    coordinates: Coordinates
    parameters: Floats
    shape: Shape
    rests: RestEvaluation
    rest_of_outcome: Integers
    thrown: ThrownOdds | None = None

    @property
    def outcome_facets(self) -> Integers:
        """(k,) facet of each outcome."""
        return self.rests.paths.rests[self.rest_of_outcome]

    @property
    def directions(self) -> Floats:
        """(k, 3) normals of those facets."""
        return self.rests.hull.normals[self.outcome_facets]

    @cached_property
    def odds(self) -> Floats:
        """(k,) probabilities of the outcomes."""
        odds = self.rests.odds if self.thrown is None else self.thrown.odds(self.rests)
        return odds[self.rest_of_outcome]

    @cached_property
    def signed_depths(self) -> Tensor:
        """(m,) how surely each facet is what it is, a rest or none: its depth
        (`RestEvaluation.facet_depths`), with the other sign for facets that are no rests."""
        sign = np.full(len(self.rests.hull.normals), -1.0)
        sign[self.outcome_facets] = 1.0
        return torch.as_tensor(sign) * self.rests.facet_depths

    def error(self, target: Floats) -> float:
        """Largest |p - q| for target probabilities (k,)."""
        return float(np.abs(self.odds - target).max())

    @cached_property
    def odds_jacobian(self) -> Floats:
        """(k, n) derivatives of the odds in the parameters, those of all outcomes in one sweep."""
        if self.thrown is not None:
            return self._in_parameters(self.thrown.jacobian(self.rests)[self.rest_of_outcome])
        return self._in_parameters(self.rests.jacobian[self.rest_of_outcome])

    def jacobian(self, *values: Tensor) -> Floats:
        """(r, n) derivatives of the values of vectors, r in all, in the parameters."""
        rows = [_rows(vector, self.rests.vertices) for vector in values]
        return self._in_parameters(np.concatenate(rows))

    def _in_parameters(self, rows: Floats) -> Floats:
        """(r, n) the Jacobian in the parameters for that (r, 3 v) in the hull's vertices."""
        return self.shape.in_parameters(rows, self.rests.hull.source)


def _rows(values: Tensor, vertices: Tensor) -> Floats:
    """(r, 3 v) derivatives of values (r,) in vertices (v, 3), one backward pass for each."""
    rows = np.zeros((len(values), vertices.numel()))
    for number, row in enumerate(rows):
        # One value, whose own gradient is 1: torch imports much to check a given one.
        (gradient,) = torch.autograd.grad(values[number], vertices, retain_graph=True)
        row[:] = gradient.numpy().ravel()
    return rows


@dataclass
class TrialMaker:
    """Makes trials, and remembers the hulls of the last ones.

    Attributes
    ----------
    center_of_mass: (3,) fixed, or None for that of the uniform solid.
    thrown: the model of odds when thrown, or None for odds without momentum.
    evaluations: how many trials were asked for.
    shapes, polars: memories of the hulls of dice, and of those that coordinates need.
    """

    center_of_mass: Floats | None
    thrown: ThrownOdds | None = None
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
        given = self.center_of_mass
        center = None if given is None else torch.as_tensor(given)
        try:
            shape = coordinates.shape(parameters, self.polars.hull)
            points = torch.from_numpy(shape.points).requires_grad_()
            rests = evaluate_rests(points, center, self.shapes.hull).untied()
            stable = rests.hull.normals[rests.paths.rests]
            nearest = np.argmax(directions @ stable.T, axis=1)
            if not np.array_equal(np.sort(nearest), np.arange(len(stable))):
                return None
            trial = Trial(coordinates, parameters, shape, rests, nearest, self.thrown)
            return trial if np.isfinite(trial.odds).all() else None
        except (DiceError, Tie, np.linalg.LinAlgError):
            return None
