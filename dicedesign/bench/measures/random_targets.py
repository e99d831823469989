"""The exact method on random targets, and descent given the same time."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from dicedesign.bench.rows import Row
from dicedesign.optimize.options import DescentOptions, ExactOptions, Stopping
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.solvers.descent import descend_to_target
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.starts.repulsion import repulsion
from dicedesign.optimize.starts.search import shapes_near
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats

__all__ = ["STARTS", "Attempt", "attempt_target", "checked", "random_target"]

OUTCOMES: Final = (4, 12)
"""Fewest and most of a target."""

SMALLEST: Final = 0.01
"""Smallest probability of a target."""

TOLERANCE: Final = 1e-12
"""Largest |p - q| of a solved target."""

STARTS: Final = 40
"""Most shapes the exact method starts from."""

LEAST_SECONDS: Final = 0.1
"""Descent gets so many seconds at least."""


@dataclass(frozen=True)
class Attempt(Row):
    """One target by both methods.

    Attributes
    ----------
    number: of the target, which is the seed of everything random.
    target: (k,) wanted probabilities.
    status: why the exact method stopped, in small letters.
    rests: stable facets of its die by the forward model; k are wanted.
    error: largest |p - q| by the forward model; infinite unless there is one rest for each outcome
        and no other.
    seconds: wall-clock time of the exact method, the search for starting shapes included.
    descent_seconds: what descent was given: `seconds`, or `LEAST_SECONDS` if that is more.
    descent_error: smallest of its largest |p - q| in that time, over the clusters of rests.
    """

    table: ClassVar[str | None] = "targets"
    printed: ClassVar[bool] = False
    computed: ClassVar[tuple[str, ...]] = ("outcomes", "solved")

    number: int
    target: tuple[float, ...]
    status: str
    rests: int
    error: float
    seconds: float
    descent_seconds: float
    descent_error: float

    @property
    def outcomes(self) -> int:
        """How many outcomes the target has."""
        return len(self.target)

    @property
    def solved(self) -> bool:
        """Whether the die has the wanted rests and no others, with the odds wanted."""
        return self.error <= TOLERANCE


def random_target(number: int) -> Floats:
    """(k,) probabilities of at least `SMALLEST` that sum to 1, evenly distributed among those.

    number: seed of the probabilities; k goes through 4 to 12 with it.
    """
    fewest, most = OUTCOMES
    outcomes = fewest + number % (most - fewest + 1)
    shares = np.random.default_rng(number).dirichlet(np.ones(outcomes))
    return SMALLEST + (1.0 - SMALLEST * outcomes) * shares


def attempt_target(number: int, seconds: float, least_seconds: float = LEAST_SECONDS) -> Attempt:
    """One random target by both methods, the exact one for at most so many seconds."""
    target = random_target(number)
    options = ExactOptions(
        tolerance=TOLERANCE, prefer=Preferences(), starts=STARTS, seconds=seconds
    )
    started = time.perf_counter()
    result = solve_exactly(shapes_near(target, number), target, options)
    taken = time.perf_counter() - started
    rests, error = checked(result.hull.vertices, result.directions, target)
    given = max(taken, least_seconds)
    return Attempt(
        number=number,
        target=tuple(target.tolist()),
        status=result.status.name.lower(),
        rests=rests,
        error=error,
        seconds=taken,
        descent_seconds=given,
        descent_error=_descent_error(target, number, given),
    )


def checked(vertices: Floats, directions: Floats, target: Floats) -> tuple[int, float]:
    """Rests of a die by the forward model, and its largest |p - q|: infinite unless each of the
    directions (k, 3) has one rest and there is no other."""
    poses = rest_poses(vertices)
    outcome = np.argmax(poses.normals @ directions.T, axis=1)
    if not np.array_equal(np.sort(outcome), np.arange(len(target))):
        return len(outcome), float("inf")
    return len(outcome), float(np.abs(poses.probabilities - target[outcome]).max())


def _descent_error(target: Floats, seed: int, seconds: float) -> float:
    """Smallest error of descent within so many seconds, from facets in a random order. It goes on
    as long as it can, whatever the recipes' tolerance."""
    order = np.random.default_rng(seed).permutation(len(target))
    options = DescentOptions(stopping=Stopping(tolerance=TOLERANCE, seconds=seconds))
    result = descend_to_target(repulsion(len(target), seed), target[order], options, seed=seed)
    errors = [step.error for step in result.history if step.seconds <= seconds]
    return min(errors, default=result.history[0].error)
