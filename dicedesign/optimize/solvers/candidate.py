"""A die of the exact method, at one set of parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
import torch
from torch import Tensor

from dicedesign.errors import DiceError
from dicedesign.geometry.hulls.hull import HullMemory, convex_hull
from dicedesign.gradient.facet_measures import SOFTNESS, FacetEdges
from dicedesign.gradient.odds_model import OddsModel
from dicedesign.gradient.rest_odds import RestEvaluation, evaluate_rests
from dicedesign.kernels.ops import Tie
from dicedesign.optimize.coordinates.facets import Coordinates, Shape
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers

BARRIER_DEPTH: Final = 0.01
"""Depth of a facet, over the mean distance of the vertices, at which its barrier is 1."""


@dataclass(frozen=True)
class Candidate:
    """A die with one rest for each outcome and no other.

    Attributes
    ----------
    coordinates: what its parameters mean.
    parameters: (n,).
    shape: what they make.
    rests: the die.
    rest_of_outcome: (k,) index into the die's rests of each outcome.
    model: of its odds, where it is thrown or let go under a prior; None where they are those
        without momentum, with any side down alike.
    """

    coordinates: Coordinates
    parameters: Floats
    shape: Shape
    rests: RestEvaluation
    rest_of_outcome: Integers
    model: OddsModel | None = None

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
        odds = self.rests.odds if self.model is None else self.model.odds(self.rests)
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

    def dice_energy(self, target: Floats) -> float:
        """Sum of (p - q)^2 over the outcomes, for target odds (k,) (eq. 12)."""
        return float(((self.odds - target) ** 2).sum())

    @cached_property
    def odds_jacobian(self) -> Floats:
        """(k, n) derivatives of the odds in the parameters, those of all outcomes in one sweep."""
        if self.model is not None:
            return self._in_parameters(self.model.jacobian(self.rests)[self.rest_of_outcome])
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
class CandidateMaker:
    """Makes candidates, and remembers the hulls of the last ones.

    Attributes
    ----------
    center_of_mass: (3,) fixed, or None for that of the uniform solid.
    model: see `Candidate`.
    offset: (3,) of the center of mass from that of the uniform solid, where it is not fixed.
    evaluations: how many candidates were asked for.
    shapes, polars: memories of the hulls of dice, and of those that coordinates need.
    """

    center_of_mass: Floats | None
    model: OddsModel | None = None
    offset: Floats | None = None
    evaluations: int = 0
    shapes: HullMemory = field(default_factory=HullMemory)
    polars: HullMemory = field(default_factory=HullMemory)

    def attempt(
        self, coordinates: Coordinates, parameters: Floats, directions: Floats
    ) -> Candidate | None:
        """A candidate, or None where the parameters make no die with the wanted rests, or one that
        is tied: the odds of a tied body jump.

        parameters: (n,) of the coordinates; directions: (k, 3) near which each outcome's facet is.
        """
        self.evaluations += 1
        given = self.center_of_mass
        center = None if given is None else torch.as_tensor(given)
        try:
            shape = coordinates.shape(parameters, self.polars.hull)
            points = torch.from_numpy(shape.points).requires_grad_()
            rests = evaluate_rests(points, center, self.shapes.hull, self.offset).untied()
            stable = rests.hull.normals[rests.paths.rests]
            nearest = np.argmax(directions @ stable.T, axis=1)
            if not np.array_equal(np.sort(nearest), np.arange(len(stable))):
                return None
            candidate = Candidate(coordinates, parameters, shape, rests, nearest, self.model)
            return candidate if np.isfinite(candidate.odds).all() else None
        except (DiceError, Tie, np.linalg.LinAlgError):
            return None


def barrier_residuals(rests: RestEvaluation) -> Tensor:
    """(m,) inverse depths of the facets, infinite where a facet gains or loses stability: a barrier
    that keeps every facet what it is, a rest or none.

    The depth of a rest is the distance of the foot of the center of mass from the nearest edge's
    line, that of another facet how far outside of the farthest such line it lies; for both a mean
    of high power over the facet's border takes the place of the least or largest, so that depths
    are smooth.
    """
    edges = FacetEdges.of(rests, np.arange(len(rests.hull.normals)))
    inside = edges.distances(rests.center)
    stable = torch.as_tensor(rests.equilibria.stable)
    held = edges.mean_power(torch.where(stable[edges.owner], inside, 1.0), -SOFTNESS)
    outside = torch.where(stable[edges.owner], 1.0, torch.relu(-inside))
    depths = torch.where(stable, held, edges.mean_power(outside, SOFTNESS))
    size = torch.linalg.vector_norm(rests.vertices - rests.center, dim=1).mean()
    return BARRIER_DEPTH * size / depths


TRIALS: Final = 4

ROUNDED: Final = float(np.finfo(np.float32).eps) / 2.0
"""Largest error of a coordinate in single precision, over its size."""


def largest_jump(candidate: Candidate, target: Floats, prior: Prior) -> float:
    """Largest |p - q| of copies of a die whose corners are off by what a file may be; 1 where one
    is no die. target: (k,) odds under a prior."""
    corners, center = candidate.rests.hull.vertices, candidate.rests.given_center
    size, random = float(np.abs(corners).max()), np.random.default_rng(0)
    errors = []
    for _ in range(TRIALS):
        off = ROUNDED * size * random.uniform(-1.0, 1.0, corners.shape)
        try:
            hull = convex_hull(corners + off, single_precision=True)
            poses = analyse(hull, hull.centroid if center is None else center.numpy())
            errors.append(outcome_odds(poses.under(prior), candidate.directions).error(target))
        except DiceError:
            errors.append(1.0)
    return max(errors)
