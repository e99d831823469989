"""Probabilities exact to rounding: Levenberg-Marquardt on half-spaces.

The unknowns are the half-spaces of a die, of which the first ones bear the outcomes and the others
help. There are four unknowns for each outcome, so the equations p = q have many solutions, and the
smallest step to one is taken: `-J^T (J J^T + mu I)^-1 r`. Probabilities jump where a facet gains or
loses stability, so depths of facets near that edge are residuals too, which fade out at the end,
and a step that changes which facets are rests is refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.coordinates import FacetCoordinates
from dicedesign.design.differentiable import RestEvaluation, evaluate_rests
from dicedesign.design.result import DesignResult, DesignStep
from dicedesign.design.starts import Start
from dicedesign.design.stopping import Status
from dicedesign.errors import DiceError, InputError
from dicedesign.geometry.hull import convex_hull
from dicedesign.geometry.hull_reuse import HullMemory
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.options import STRICT

__all__ = ["ExactOptions", "solve_exactly"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DEPTH_MARGIN: Final = 0.03
"""Depth of a facet, over the circumscribed radius, below which it is a residual."""

WALL_WEIGHTS: Final = (0.3, 0.01, 0.0)
"""Weights of those residuals, from first to last."""

LARGEST_MOVE: Final = 0.15
"""Largest change of a parameter in one step."""

DAMPINGS: Final = (1e-14, 1e-3, 1e4)
"""Smallest, first and largest damping mu, in units of the mean square of the Jacobian's rows."""

LEAST_REFUSED: Final = 1e-6
"""Damping in the same units from which on it is raised after a refused step."""

SLOW: Final = 0.1
"""Relative decrease of the squared residuals below which the next wall weight's turn has come."""

MOST_STEPS: Final = 80
"""Steps from one start."""


@dataclass(frozen=True)
class ExactOptions:
    """Options of `method: exact`.

    Attributes
    ----------
    tolerance: largest |p - q| wanted, above 0 and below 1.
    starts: most starting shapes that are tried, at least 1.
    seconds: wall-clock time after which nothing more is tried, positive; at least one start is.
    """

    __pydantic_config__ = STRICT

    tolerance: float = 1e-12
    starts: int = 60
    seconds: float = 60.0

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number in (0, 1), got {self.tolerance:g}; leave it out for "
                "1e-12"
            )
        if self.starts < 1:
            raise InputError(
                f"starts: expected a whole number above 0, got {self.starts}; leave it out for 60"
            )
        if not 0.0 < self.seconds < np.inf:
            raise InputError(
                f"seconds: expected a positive number, got {self.seconds:g}; leave it out for 60"
            )


def solve_exactly(
    starts: Iterable[Start],
    target: Floats,
    options: ExactOptions,
    *,
    center_of_mass: Floats | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
) -> DesignResult:
    """Move the first of some starting shapes that leads there until its odds are the target.

    Every result has exactly one rest for each outcome and no other. Starts that do not have that
    are passed over.

    Parameters
    ----------
    starts: shapes with (k, 3) outcome directions, made one after the other as they are needed.
    target: (k,) wanted probability of each direction.
    options: see `ExactOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `Start.points`, or None for the uniform solid.
    on_step: called after every accepted step.

    Raises
    ------
    InputError: none of the starts has one rest for each outcome and no other.
    """
    search = _Search(target, options, center_of_mass, on_step)
    for number, start in enumerate(starts):
        if number == options.starts or (search.out_of_time and search.best is not None):
            break
        if search.solve(start):
            break
    return search.result()


@dataclass(frozen=True)
class _Trial:
    """A die at one set of parameters: m normals and logarithms of distances, as in
    `FacetCoordinates`. The first k facets bear the outcomes."""

    leaf: Tensor
    rests: RestEvaluation
    outcomes: int

    @property
    def parameters(self) -> Floats:
        return self.leaf.detach().numpy()

    @cached_property
    def half_space(self) -> Integers:
        """(m',) number of the half-space that bounds each facet."""
        normals = unit_vectors(self.parameters[: 3 * (len(self.leaf) // 4)].reshape(-1, 3))
        return np.argmax(self.rests.hull.normals @ normals.T, axis=1)

    @cached_property
    def outcome_of_rest(self) -> Integers:
        """(k,) number of the half-space of each rest."""
        return self.half_space[self.rests.paths.rests]

    @property
    def is_wanted(self) -> bool:
        """Whether the outcomes' facets and no others are rests."""
        return np.array_equal(np.sort(self.outcome_of_rest), np.arange(self.outcomes))

    @cached_property
    def probabilities(self) -> Floats:
        """(k,) of the outcomes."""
        found = np.empty(self.outcomes)
        found[self.outcome_of_rest] = self.rests.probabilities.detach().numpy()
        return found

    @cached_property
    def signed_depths(self) -> Tensor:
        """(m',) depths of the facets, those of facets without outcome with the other sign."""
        sign = np.where(self.half_space < self.outcomes, 1.0, -1.0)
        return torch.as_tensor(sign) * self.rests.facet_depths

    @cached_property
    def near_the_edge(self) -> Integers:
        """Facets whose depth is a residual."""
        return np.flatnonzero(self.signed_depths.detach().numpy() < DEPTH_MARGIN)

    def walls(self) -> Tensor:
        """What those facets lack in depth, 0 to 1 and more."""
        return 1.0 - self.signed_depths[torch.as_tensor(self.near_the_edge)] / DEPTH_MARGIN

    def merit(self, target: Floats, weight: float) -> float:
        """Sum of the squared residuals; at weight 0 the dice energy (eq. 12)."""
        misses = float(((self.probabilities - target) ** 2).sum())
        if weight == 0.0:
            return misses
        return misses + weight**2 * float((self.walls().detach() ** 2).sum())

    def residuals(self, target: Floats, weight: float) -> tuple[Floats, Floats]:
        """Residuals (r,) and their Jacobian (r, 4 m), in one batched backward pass."""
        parts = [self.rests.probabilities[torch.as_tensor(np.argsort(self.outcome_of_rest))]]
        if weight > 0.0 and len(self.near_the_edge):
            parts.append(weight * self.walls())
        values = torch.cat(parts)
        (jacobian,) = torch.autograd.grad(
            values,
            self.leaf,
            grad_outputs=torch.eye(len(values), dtype=torch.float64),
            is_grads_batched=True,
        )
        misses = values.detach().numpy().copy()
        misses[: self.outcomes] -= target
        return misses, jacobian.numpy()


@dataclass
class _Search:
    """The best die so far, over all starts."""

    target: Floats
    options: ExactOptions
    center_of_mass: Floats | None
    on_step: Callable[[DesignStep], None] | None
    best: tuple[_Trial, float] | None = None
    history: list[DesignStep] = field(default_factory=list)
    evaluations: int = 0
    memories: tuple[HullMemory, HullMemory] = field(
        default_factory=lambda: (HullMemory(), HullMemory())
    )

    def __post_init__(self) -> None:
        self.started = time.perf_counter()

    @property
    def out_of_time(self) -> bool:
        return time.perf_counter() - self.started >= self.options.seconds

    def solve(self, start: Start) -> bool:
        """Levenberg-Marquardt from one start; whether it reached the tolerance."""
        coordinates, parameters = _sorted_half_spaces(start, self.center_of_mass)
        current = self._attempt(coordinates, parameters)
        if current is None:
            return False
        weights = iter(WALL_WEIGHTS)
        weight, damping = next(weights), DAMPINGS[1]
        reached = self._record(current)
        for _ in range(MOST_STEPS):
            if reached or self.out_of_time:
                break
            following, damping = self._step(coordinates, current, weight, damping)
            before = current.merit(self.target, weight)
            if following is not None:
                gained = 1.0 - following.merit(self.target, weight) / before
                current, reached = following, self._record(following)
                if gained >= SLOW:
                    continue
            if weight == 0.0:
                break
            weight, damping = next(weights, 0.0), DAMPINGS[1]
        return reached

    def _step(
        self, coordinates: FacetCoordinates, current: _Trial, weight: float, damping: float
    ) -> tuple[_Trial | None, float]:
        """An acceptable trial, or None, and the damping for the next step."""
        residuals, jacobian = current.residuals(self.target, weight)
        square = jacobian @ jacobian.T
        unit = float(np.trace(square)) / len(residuals)
        merit = float((residuals**2).sum())
        while damping <= DAMPINGS[2] and np.isfinite(unit) and unit > 0.0:
            damped = square + damping * unit * np.eye(len(residuals))
            step = -jacobian.T @ np.linalg.solve(damped, residuals)
            step *= min(1.0, LARGEST_MOVE / float(np.abs(step).max()))
            trial = self._attempt(coordinates, current.parameters + step)
            if trial is not None and trial.merit(self.target, weight) < merit:
                return trial, max(0.1 * damping, DAMPINGS[0])
            damping = max(10.0 * damping, LEAST_REFUSED)
        return None, damping

    def _attempt(self, coordinates: FacetCoordinates, parameters: Floats) -> _Trial | None:
        """A trial, or None where the parameters make no die with the wanted rests."""
        self.evaluations += 1
        leaf = torch.tensor(parameters, requires_grad=True)
        given = self.center_of_mass
        center = None if given is None else torch.as_tensor(given)
        polars, shapes = self.memories
        try:
            points = coordinates.points(leaf, polars.hull)
            trial = _Trial(leaf, evaluate_rests(points, center, shapes.hull), len(self.target))
            return trial if trial.is_wanted and np.isfinite(trial.probabilities).all() else None
        except (DiceError, torch.linalg.LinAlgError):
            return None

    def _record(self, trial: _Trial) -> bool:
        """Take note of an accepted trial; whether it is within the tolerance."""
        error = float(np.abs(trial.probabilities - self.target).max())
        if self.best is None or error < self.best[1]:
            self.best = trial, error
        energy = trial.merit(self.target, 0.0)
        seconds = time.perf_counter() - self.started
        step = DesignStep(len(self.history), seconds, energy, {"dice": energy}, error)
        self.history.append(step)
        if self.on_step is not None:
            self.on_step(step)
        return error <= self.options.tolerance

    def result(self) -> DesignResult:
        """The best die of all starts."""
        if self.best is None:
            raise InputError(
                f"start: expected a shape with one rest for each of {len(self.target)} outcomes "
                "and no other, got none; take another start"
            )
        trial, error = self.best
        status = Status.NO_PROGRESS
        if error <= self.options.tolerance:
            status = Status.CONVERGED
        elif self.out_of_time:
            status = Status.TIME_LIMIT
        polars, shapes = self.memories
        directions = np.empty((len(self.target), 3))
        directions[trial.outcome_of_rest] = trial.rests.hull.normals[trial.rests.paths.rests]
        return DesignResult(
            status,
            trial.rests.hull,
            directions,
            {"dice": trial.merit(self.target, 0.0)},
            tuple(self.history),
            self.evaluations,
            polars.built + shapes.built,
            polars.reused + shapes.reused,
        )


def _sorted_half_spaces(
    start: Start, center_of_mass: Floats | None
) -> tuple[FacetCoordinates, Floats]:
    """Coordinates of a start, and its parameters with the outcomes' half-spaces first."""
    hull = convex_hull(start.points)
    origin = hull.centroid if center_of_mass is None else center_of_mass
    coordinates, parameters = FacetCoordinates.of(start.points, origin, lambda points: hull)
    count = len(parameters) // 4
    normals, heights = parameters[: 3 * count].reshape(count, 3), parameters[3 * count :]
    first = np.argmax(start.directions @ normals.T, axis=1)
    order = np.concatenate([first, np.setdiff1d(np.arange(count), first)])
    return coordinates, np.concatenate([normals[order].ravel(), heights[order]])
