"""Gradient descent on the dice energy (section 3.3), with the hull recomputed at every trial."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from dicedesign.design.coordinates import Coordinates, FacetCoordinates, VertexCoordinates
from dicedesign.design.energy import EnergyWeights
from dicedesign.design.line_search import LineSearch
from dicedesign.design.objective import Evaluation, Objective
from dicedesign.design.sobolev import SobolevOptions, SobolevSolver, graph_laplacian
from dicedesign.design.starts import Start
from dicedesign.design.stopping import Status, Stopping
from dicedesign.errors import InputError
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.options import STRICT
from dicedesign.rest.equilibria import classify

__all__ = ["DescentOptions", "DescentResult", "DescentStep", "descend_to_target"]

Floats = NDArray[np.float64]

STALL_WINDOW: Final = 10
"""Number of last energies that tell whether progress stalls: the later half against the earlier."""

STALL_DECREASE: Final = 0.02
"""Relative decrease of the energy over half a window below which progress has stalled."""

LAST_WINDOW: Final = 200
"""The same number once the shaping terms are dropped, when narrow valleys take long."""

LAST_DECREASE: Final = 0.05
"""Relative decrease over half of it below which there is no progress left."""

SMALLEST_RELAXATION: Final = 1e-3
"""Factor on the shaping terms below which they are dropped."""


@dataclass(frozen=True)
class DescentOptions:
    """Options of `method: descent`.

    Attributes
    ----------
    coordinates: "facets" keeps every facet flat; "vertices" moves vertices as the paper does.
    weights: of the energy's terms.
    sobolev: preconditioning of vertex gradients, or None; needs `coordinates` "vertices".
    stopping: tolerance and limits.
    relaxation: factor on the barycenter and neighbor weights each time progress stalls, in (0, 1);
        those two terms shape the die first and then give way to the probabilities.
    perturbation: standard deviation of the seeded noise on the starting parameters, which breaks
        the ties of symmetric shapes; not negative.
    """

    __pydantic_config__ = STRICT

    coordinates: Literal["facets", "vertices"] = "facets"
    weights: EnergyWeights = field(default_factory=EnergyWeights)
    sobolev: SobolevOptions | None = None
    stopping: Stopping = field(default_factory=Stopping)
    relaxation: float = 0.5
    perturbation: float = 1e-3

    def __post_init__(self) -> None:
        if self.coordinates not in ("facets", "vertices"):
            raise InputError(
                f'coordinates: expected "facets" or "vertices", got {self.coordinates!r}; choose '
                "one of the two"
            )
        if self.sobolev is not None and self.coordinates != "vertices":
            raise InputError(
                'sobolev: expected coordinates "vertices", whose gradient lives on the surface, '
                f"got {self.coordinates!r}; leave sobolev out or change coordinates"
            )
        if not 0.0 < self.relaxation < 1.0:
            raise InputError(
                f"relaxation: expected a number in (0, 1), got {self.relaxation:g}; leave it out "
                "for 0.5"
            )
        if not 0.0 <= self.perturbation < 1.0:
            raise InputError(
                f"perturbation: expected a number in [0, 1), got {self.perturbation:g}; leave it "
                "out for 1e-3"
            )


@dataclass(frozen=True)
class DescentStep:
    """One accepted step: seconds since the start, weighted energy terms, largest |p - q|."""

    step: int
    seconds: float
    energy: float
    terms: dict[str, float]
    error: float


@dataclass(frozen=True)
class DescentResult:
    """Where a descent ended.

    Attributes
    ----------
    status: why it stopped.
    hull: the designed shape.
    directions: (k, 3) where the outcomes are.
    terms: the energy's terms at the end, with their full weights.
    history: every accepted step, the first being the start.
    evaluations: energies computed, those of rejected trials and after pruning included.
    """

    status: Status
    hull: ConvexHull
    directions: Floats
    terms: dict[str, float]
    history: tuple[DescentStep, ...]
    evaluations: int


def descend_to_target(
    start: Start,
    target: Floats,
    options: DescentOptions,
    *,
    center_of_mass: Floats | None = None,
    seed: int = 0,
    on_step: Callable[[DescentStep], None] | None = None,
) -> DescentResult:
    """Move a starting shape until its rests have the target probabilities.

    Parameters
    ----------
    start: shape and outcome directions.
    target: (k,) wanted probability of each direction of the start.
    options: see `DescentOptions`.
    center_of_mass: (3,) fixed, in the coordinates of `start.points`, or None for the uniform solid.
    seed: of the perturbation.
    on_step: called after every accepted step.

    Raises
    ------
    InputError: the target does not have one probability for each direction, or the center of mass
        is not three finite numbers.
    DegenerateBodyError, OutsideHullError: the start is no solid with the center inside.
    """
    if len(target) != len(start.directions):
        raise InputError(
            f"target: expected {len(start.directions)} outcomes, one for each direction of the "
            f"start, got {len(target)}; take another start"
        )
    return _Descent(start, target, options, center_of_mass, seed, on_step).run()


class _Descent:
    """The loop: direction, step, new hull, stop."""

    def __init__(
        self,
        start: Start,
        target: Floats,
        options: DescentOptions,
        center_of_mass: Floats | None,
        seed: int,
        on_step: Callable[[DescentStep], None] | None,
    ) -> None:
        hull = convex_hull(start.points)
        origin = hull.centroid
        if center_of_mass is not None:
            origin = center_of_mass = classify(hull, center_of_mass).center_of_mass
        coordinates: Coordinates
        if options.coordinates == "facets":
            coordinates, parameters = FacetCoordinates.of(start.points, origin)
        else:
            coordinates, parameters = VertexCoordinates.of(start.points, origin)
        noise = np.random.default_rng(seed).normal(size=parameters.shape)
        self.options = options
        self.relaxation = 1.0
        self.objective = Objective(coordinates, target, options.weights, center_of_mass)
        self.started = time.perf_counter()
        self.on_step = on_step
        self.line_search = LineSearch()
        self.evaluations = 1
        self.history: list[DescentStep] = []
        self.energies: list[float] = []
        self.current = self.objective.evaluate(
            parameters + options.perturbation * noise, start.directions
        ).refreshed()
        self.sobolev: tuple[ConvexHull, SobolevSolver] | None = None

    def run(self) -> DescentResult:
        self._record()
        status = None
        while status is None:
            status = self._advance()
        full = replace(self.objective, weights=self.options.weights)
        return DescentResult(
            status,
            self.current.rests.hull,
            self.current.directions,
            self.current.under(full).values,
            tuple(self.history),
            self.evaluations + self.line_search.evaluations,
        )

    def _advance(self) -> Status | None:
        limit = self.options.stopping.limit(self.history[-1].step, self._seconds())
        if limit is not None:
            return Status.CONVERGED if self._reached() else limit
        following = self.line_search.search(self.current, self._direction())
        if following is not None:
            self._accept(following)
            if not self._stalled(STALL_WINDOW, STALL_DECREASE):
                return None
        # At rest under the present weights: done, or let the shaping terms give way.
        if self._reached():
            return Status.CONVERGED
        if self.relaxation == 0.0:
            ended = following is None or self._stalled(LAST_WINDOW, LAST_DECREASE)
            return Status.NO_PROGRESS if ended else None
        self._relax()
        return None

    def _direction(self) -> Floats:
        gradient = self.current.gradient
        if self.options.sobolev is None:
            return gradient
        hull = self.current.rests.hull
        if self.sobolev is None or not _same_edges(self.sobolev[0], hull):
            self.sobolev = (hull, SobolevSolver(graph_laplacian(hull), self.options.sobolev))
        smooth = np.zeros((len(gradient) // 3, 3))
        smooth[hull.source] = self.sobolev[1].solve(gradient.reshape(-1, 3)[hull.source])
        return smooth.ravel()

    def _accept(self, following: Evaluation) -> None:
        pruned = self.objective.coordinates.pruned(following.parameters, following.rests)
        if len(pruned) != len(following.parameters):
            following = self.objective.evaluate(pruned, following.directions)
            self.evaluations += 1
            self.line_search.restart()
        self.current = following.refreshed()
        self._record()

    def _reached(self) -> bool:
        return self.current.error <= self.options.stopping.tolerance

    def _stalled(self, window: int, decrease: float) -> bool:
        if len(self.energies) <= window:
            return False
        recent = self.energies[-window:]
        half = window // 2
        # Below the square of the tolerance an energy has nothing more to say.
        worth = max(self.current.value, self.options.stopping.tolerance**2)
        return min(recent[:half]) - min(recent[half:]) < decrease * worth

    def _relax(self) -> None:
        self.relaxation *= self.options.relaxation
        if self.relaxation < SMALLEST_RELAXATION:
            self.relaxation = 0.0
        weights = self.options.weights.relaxed(self.relaxation)
        self.objective = replace(self.objective, weights=weights)
        self.current = self.current.under(self.objective)
        self.line_search.restart()
        self.energies.clear()

    def _seconds(self) -> float:
        return time.perf_counter() - self.started

    def _record(self) -> None:
        current = self.current
        self.energies.append(current.value)
        step = DescentStep(
            len(self.history), self._seconds(), current.value, current.values, current.error
        )
        self.history.append(step)
        if self.on_step is not None:
            self.on_step(step)


def _same_edges(a: ConvexHull, b: ConvexHull) -> bool:
    return (
        len(a.tail) == len(b.tail)
        and len(a.vertices) == len(b.vertices)
        and bool((a.tail == b.tail).all() and (a.twin == b.twin).all())
    )
