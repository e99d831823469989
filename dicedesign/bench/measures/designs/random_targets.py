"""The exact method on random targets, and the paper's given the same number of starts."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from dicedesign.bench.rows import Row
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.paper_options import PaperOptions
from dicedesign.optimize.preferences.preference import Preferences
from dicedesign.optimize.solvers.exact import solve_exactly
from dicedesign.optimize.solvers.paper import descend_as_paper
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
    starts: shapes that it tried.
    paper_seconds: of the paper's method without a finish from as many starts.
    paper_error: smallest of its largest |p - q| at the end, over the clusters of rests.
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
    starts: int
    paper_seconds: float
    paper_error: float

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


def attempt_target(number: int, seconds: float) -> Attempt:
    """One random target by both methods, the exact one for at most so many seconds."""
    target = random_target(number)
    options = ExactOptions(
        tolerance=TOLERANCE, prefer=Preferences(), starts=STARTS, seconds=seconds
    )
    started = time.perf_counter()
    result = solve_exactly(shapes_near(target, number), target, options)
    taken = time.perf_counter() - started
    rests, error = checked(result.hull.vertices, result.directions, target)
    started = time.perf_counter()
    paper_error = min(_paper_error(target, number, turn) for turn in range(result.starts))
    paper_seconds = time.perf_counter() - started
    return Attempt(
        number=number,
        target=tuple(target.tolist()),
        status=result.status.name.lower(),
        rests=rests,
        error=error,
        seconds=taken,
        starts=result.starts,
        paper_seconds=paper_seconds,
        paper_error=paper_error,
    )


def checked(vertices: Floats, directions: Floats, target: Floats) -> tuple[int, float]:
    """Rests of a die by the forward model, and its largest |p - q|: infinite unless each of the
    directions (k, 3) has one rest and there is no other."""
    poses = rest_poses(vertices)
    outcome = np.argmax(poses.normals @ directions.T, axis=1)
    if not np.array_equal(np.sort(outcome), np.arange(len(target))):
        return len(outcome), float("inf")
    return len(outcome), float(np.abs(poses.probabilities - target[outcome]).max())


def _paper_error(target: Floats, number: int, turn: int) -> float:
    """Error at the end of the paper's method, from evenly spread facets in a random order."""
    seed = number + 1000 * turn
    order = np.random.default_rng(seed).permutation(len(target))
    start = repulsion(len(target), seed)
    return descend_as_paper(start, target[order], PaperOptions(finish="none"), seed=seed).error
