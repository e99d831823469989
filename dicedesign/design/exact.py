"""Probabilities exact to rounding, by Levenberg-Marquardt.

The unknowns are the half-spaces of a die, or its vertices. There are several for each outcome, so
the equations p = q have many solutions, and the shortest step to one is taken:
`-W^-1 J^T (J W^-1 J^T + mu I)^-1 r` in a metric W. Probabilities jump where a facet gains or loses
stability, so depths of facets near that edge are residuals too, which fade out at the end, and a
step that changes which facets are rests is refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dicedesign.design.coordinates import Coordinates, FacetCoordinates, VertexCoordinates
from dicedesign.design.result import DesignResult, DesignStep
from dicedesign.design.sobolev import SobolevOptions, SobolevSolver, graph_laplacian
from dicedesign.design.starts import Start
from dicedesign.design.stopping import Status
from dicedesign.design.symmetric_coordinates import SymmetricCoordinates
from dicedesign.design.trial import Trial, TrialMaker
from dicedesign.errors import InputError
from dicedesign.geometry.hull import convex_hull
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
    coordinates: "facets" moves half-spaces and keeps every facet flat; "vertices" moves vertices,
        so that facets become triangles.
    sobolev: the metric `(I + lambda L)^p` in which steps are shortest, of the graph Laplacian L; it
        needs `coordinates` "vertices". None for lengths as they are.
    starts: most starting shapes that are tried, at least 1.
    seconds: wall-clock time after which nothing more is tried, positive; at least one start is.
    """

    __pydantic_config__ = STRICT

    tolerance: float = 1e-12
    coordinates: Literal["facets", "vertices"] = "facets"
    sobolev: SobolevOptions | None = None
    starts: int = 60
    seconds: float = 60.0

    def __post_init__(self) -> None:
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(
                f"tolerance: expected a number in (0, 1), got {self.tolerance:g}; leave it out for "
                "1e-12"
            )
        if self.coordinates not in ("facets", "vertices"):
            raise InputError(
                f'coordinates: expected "facets" or "vertices", got {self.coordinates!r}; choose '
                "one of the two"
            )
        if self.sobolev is not None and self.coordinates != "vertices":
            raise InputError(
                'sobolev: expected coordinates "vertices", whose neighbours move together, got '
                f"{self.coordinates!r}; leave sobolev out or change coordinates"
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
    group: Floats | None = None,
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
    group: (g, 3, 3) a point group that the starts and the die have as symmetry, about the origin,
        or None. Outcomes whose facets are images of each other are equally probable.
    on_step: called after every accepted step.

    Raises
    ------
    InputError: none of the starts has one rest for each outcome and no other; a start without the
        symmetry.
    """
    search = _Search(target, options, center_of_mass, group, on_step)
    for number, start in enumerate(starts):
        if number == options.starts or (search.out_of_time and search.best is not None):
            break
        if search.solve(start):
            break
    return search.result()


@dataclass
class _Search:
    """The best die so far, over all starts."""

    target: Floats
    options: ExactOptions
    center_of_mass: Floats | None
    group: Floats | None
    on_step: Callable[[DesignStep], None] | None
    best: Trial | None = None
    history: list[DesignStep] = field(default_factory=list)
    evaluations: int = 0

    def __post_init__(self) -> None:
        self.started = time.perf_counter()
        self.maker = TrialMaker(self.center_of_mass)

    @property
    def out_of_time(self) -> bool:
        return time.perf_counter() - self.started >= self.options.seconds

    def solve(self, start: Start) -> bool:
        """Levenberg-Marquardt from one start; whether it reached the tolerance."""
        coordinates, parameters = self._coordinates(start)
        current = self.maker.attempt(coordinates, parameters, start.directions)
        if current is None:
            return False
        weights = iter(WALL_WEIGHTS)
        weight, damping = next(weights), DAMPINGS[1]
        reached = self._record(current)
        for _ in range(MOST_STEPS):
            if reached or self.out_of_time:
                break
            following, damping = self._step(current, weight, damping)
            before = _merit(current, self.target, weight)
            if following is not None:
                gained = 1.0 - _merit(following, self.target, weight) / before
                current = self._pruned(following)
                reached = self._record(current)
                if gained >= SLOW:
                    continue
            if weight == 0.0:
                break
            weight, damping = next(weights, 0.0), DAMPINGS[1]
        return reached

    def _coordinates(self, start: Start) -> tuple[Coordinates, Floats]:
        hull = convex_hull(start.points)
        origin = hull.centroid if self.center_of_mass is None else self.center_of_mass
        if self.options.coordinates == "vertices":
            return VertexCoordinates.of(start.points, origin, lambda points: hull)
        if self.group is not None:
            return SymmetricCoordinates.of(start.points, origin, self.group, lambda points: hull)
        return FacetCoordinates.of(start.points, origin, lambda points: hull)

    def _step(self, current: Trial, weight: float, damping: float) -> tuple[Trial | None, float]:
        """An acceptable trial, or None, and the damping for the next step."""
        values = _residuals(current, self.target, weight)
        residuals, jacobian = values.detach().numpy(), current.jacobian(values)
        raised = self._raised(current, jacobian)
        square = jacobian @ raised
        unit = float(np.trace(square)) / len(residuals)
        merit = float((residuals**2).sum())
        while damping <= DAMPINGS[2] and np.isfinite(unit) and unit > 0.0:
            damped = square + damping * unit * np.eye(len(residuals))
            step = -raised @ np.linalg.solve(damped, residuals)
            step *= min(1.0, LARGEST_MOVE / float(np.abs(step).max()))
            trial = self._attempt(current, current.parameters + step)
            if trial is not None and _merit(trial, self.target, weight) < merit:
                return trial, max(0.1 * damping, DAMPINGS[0])
            damping = max(10.0 * damping, LEAST_REFUSED)
        return None, damping

    def _raised(self, current: Trial, jacobian: Floats) -> Floats:
        """(n, r) columns W^-1 J^T for the Jacobian (r, n), in the metric W of the options."""
        if self.options.sobolev is None:
            return jacobian.T
        hull = current.rests.hull
        columns = jacobian.T.reshape(-1, 3 * len(jacobian))
        smooth = np.zeros_like(columns)
        solver = SobolevSolver(graph_laplacian(hull), self.options.sobolev)
        smooth[hull.source] = solver.solve(columns[hull.source])
        return smooth.reshape(jacobian.T.shape)

    def _attempt(self, current: Trial, parameters: Floats) -> Trial | None:
        return self.maker.attempt(current.coordinates, parameters, current.directions)

    def _pruned(self, trial: Trial) -> Trial:
        """The trial without the parameters that its shape no longer uses."""
        pruned = trial.coordinates.pruned(trial.parameters, trial.rests)
        if len(pruned) == len(trial.parameters):
            return trial
        return self._attempt(trial, pruned) or trial

    def _record(self, trial: Trial) -> bool:
        """Take note of an accepted trial; whether it is within the tolerance."""
        error = trial.error(self.target)
        if self.best is None or error < self.best.error(self.target):
            self.best = trial
        energy = _merit(trial, self.target, 0.0)
        seconds = time.perf_counter() - self.started
        step = DesignStep(len(self.history), seconds, energy, {"dice": energy}, error)
        self.history.append(step)
        if self.on_step is not None:
            self.on_step(step)
        return error <= self.options.tolerance

    def result(self) -> DesignResult:
        """The best die of all starts."""
        best = self.best
        if best is None:
            raise InputError(
                f"start: expected a shape with one rest for each of {len(self.target)} outcomes "
                "and no other, got none; take another start"
            )
        status = Status.NO_PROGRESS
        if best.error(self.target) <= self.options.tolerance:
            status = Status.CONVERGED
        elif self.out_of_time:
            status = Status.TIME_LIMIT
        polars, shapes = self.maker.polars, self.maker.shapes
        return DesignResult(
            status,
            best.rests.hull,
            best.directions,
            {"dice": _merit(best, self.target, 0.0)},
            tuple(self.history),
            self.maker.evaluations,
            polars.built + shapes.built,
            polars.reused + shapes.reused,
        )


def _near_the_edge(trial: Trial) -> Tensor:
    """What facets whose depth is below the margin lack of it, 0 to 1 and more."""
    depths = trial.depths
    near = np.flatnonzero(depths.detach().numpy() < DEPTH_MARGIN)
    return 1.0 - depths[torch.as_tensor(near)] / DEPTH_MARGIN


def _residuals(trial: Trial, target: Floats, weight: float) -> Tensor:
    """(r,) p - q, and with a weight above 0 what facets lack in depth."""
    misses = trial.odds - torch.as_tensor(target)
    return misses if weight == 0.0 else torch.cat([misses, weight * _near_the_edge(trial)])


def _merit(trial: Trial, target: Floats, weight: float) -> float:
    """Sum of the squared residuals; at weight 0 the dice energy (eq. 12)."""
    return float((_residuals(trial, target, weight).detach() ** 2).sum())
