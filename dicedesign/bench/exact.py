"""The exact method on random targets, and descent given the same time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, Final

import numpy as np

from dicedesign.design.options import DescentOptions, ExactOptions, Stopping
from dicedesign.design.preferences.preference import Preferences
from dicedesign.design.result import DesignResult
from dicedesign.design.solvers.descent import descend_to_target
from dicedesign.design.solvers.exact import solve_exactly
from dicedesign.design.starts.repulsion import repulsion
from dicedesign.design.starts.search import shapes_near
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Floats

__all__ = [
    "STARTS",
    "Attempt",
    "Summary",
    "attempt_target",
    "random_target",
    "run_targets",
    "summaries",
]

FEWEST_OUTCOMES: Final = 4

MOST_OUTCOMES: Final = 12

SMALLEST: Final = 0.01
"""Smallest probability of a target."""

TOLERANCE: Final = 1e-12
"""Largest |p - q| of a solved target."""

STARTS: Final = 40
"""Most shapes the exact method starts from."""

LEAST_SECONDS: Final = 0.1
"""Descent gets so many seconds at least."""


@dataclass(frozen=True)
class Attempt:
    """One target by both methods.

    Attributes
    ----------
    number: of the target, which is the seed of everything random.
    target: (k,) wanted probabilities.
    status: why the exact method stopped: the name of a `Status`.
    rests: stable facets of its die by the forward model; k are wanted.
    error: largest |p - q| by the forward model; infinite unless there is one rest for each outcome
        and no other.
    seconds: wall-clock time of the exact method, the search for starting shapes included.
    descent_seconds: what descent was given: `seconds`, or `LEAST_SECONDS` if that is more.
    descent_error: smallest of its largest |p - q| in that time, over the clusters of rests.
    """

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

    def plain(self) -> dict[str, Any]:
        """Everything for JSON."""
        return {**asdict(self), "outcomes": self.outcomes, "solved": self.solved}


@dataclass(frozen=True)
class Summary:
    """Attempts at targets of so many outcomes.

    Attributes
    ----------
    outcomes: how many, or None for all attempts.
    targets, solved: how many were tried and how many solved.
    median_seconds: of the exact method, solved or not.
    worst_seconds: of the solved ones, nan if there are none.
    median_descent_error, worst_descent_error: of descent in the same time.
    """

    outcomes: int | None
    targets: int
    solved: int
    median_seconds: float
    worst_seconds: float
    median_descent_error: float
    worst_descent_error: float


def random_target(number: int) -> Floats:
    """(k,) probabilities of at least `SMALLEST` that sum to 1, evenly distributed among those.

    number: seed of the probabilities; k goes through 4 to 12 with it.
    """
    outcomes = FEWEST_OUTCOMES + number % (MOST_OUTCOMES - FEWEST_OUTCOMES + 1)
    shares = np.random.default_rng(number).dirichlet(np.ones(outcomes))
    return SMALLEST + (1.0 - SMALLEST * outcomes) * shares


def run_targets(
    count: int, seconds: float, on_target: Callable[[str], None] | None = None
) -> Iterator[Attempt]:
    """Attempts at the first random targets, one after the other.

    Another target is solved before, which is not counted: the first use of torch in a process takes
    longer.

    Parameters
    ----------
    count: of targets.
    seconds: limit of the exact method for each.
    on_target: called with a description of each target before it is tried.
    """
    attempt_target(count, seconds)
    for number in range(count):
        if on_target is not None:
            on_target(f"target {number}")
        yield attempt_target(number, seconds)


def attempt_target(number: int, seconds: float) -> Attempt:
    """One random target by both methods, the exact one for at most so many seconds."""
    target = random_target(number)
    options = ExactOptions(
        tolerance=TOLERANCE, prefer=Preferences(), starts=STARTS, seconds=seconds
    )
    started = time.perf_counter()
    result = solve_exactly(shapes_near(target, number), target, options)
    taken = time.perf_counter() - started
    rests, error = _checked(result, target)
    given = max(taken, LEAST_SECONDS)
    return Attempt(
        number=number,
        target=tuple(target.tolist()),
        status=result.status.name,
        rests=rests,
        error=error,
        seconds=taken,
        descent_seconds=given,
        descent_error=_descent_error(target, number, given),
    )


def summaries(attempts: Sequence[Attempt]) -> list[Summary]:
    """A summary for each number of outcomes, and the last one of all; attempts: at least one."""
    numbers = sorted({attempt.outcomes for attempt in attempts})
    groups = [(k, [a for a in attempts if a.outcomes == k]) for k in numbers]
    return [_summary(outcomes, group) for outcomes, group in [*groups, (None, attempts)]]


def _summary(outcomes: int | None, attempts: Sequence[Attempt]) -> Summary:
    solved = [attempt.seconds for attempt in attempts if attempt.solved]
    descent = [attempt.descent_error for attempt in attempts]
    return Summary(
        outcomes,
        len(attempts),
        len(solved),
        median(attempt.seconds for attempt in attempts),
        max(solved, default=float("nan")),
        median(descent),
        max(descent),
    )


def _checked(result: DesignResult, target: Floats) -> tuple[int, float]:
    """Rests of the die by the forward model, and its largest |p - q|."""
    poses = rest_poses(result.hull.vertices)
    outcome = np.argmax(poses.normals @ result.directions.T, axis=1)
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
