"""A search: trials are proposed, run side by side, and remembered."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from typing import Any, Final

from dicedesign.errors import DiceError
from dicedesign.runtime.executors import is_lost_worker
from dicedesign.search.study import SearchStudy
from dicedesign.search.trial import run_trial

__all__ = ["run_search"]

MOST_LOSSES: Final = 5
"""Times that a worker may be lost while one trial runs before the search gives up. Not every such
trial is to blame: a local worker that is lost takes down all that run beside it."""

QUIET: Final = 10.0
"""Seconds without a result after which a caller is told so."""


@dataclass
class _Flight:
    """A trial that runs: its number, its recipe, and how often a worker was lost meanwhile."""

    number: int
    recipe: dict[str, Any]
    losses: int = 0


def run_search(
    study: SearchStudy,
    trials: int,
    executor: Executor,
    jobs: int,
    *,
    on_trial: Callable[[dict[str, Any]], None] | None = None,
    on_quiet: Callable[[], None] | None = None,
) -> None:
    """Go on until so many trials of a study are finished.

    Each result is kept before the next trial begins. A trial whose worker was lost runs again. With
    one job the same recipe gives the same trials; with several it matters which end first.

    Parameters
    ----------
    study: see `open_study`.
    trials: how many are to be finished at the end, those of earlier searches included.
    executor: runs them; processes or machines that can import this package.
    jobs: how many run at a time, at least 1.
    on_trial: called with each result once it is kept.
    on_quiet: called whenever no trial has ended for `QUIET` seconds.

    Raises
    ------
    DiceError: a trial cannot be run, or workers are lost again and again while it runs.
    OutputError: a result cannot be kept.
    """
    flights: dict[Future[dict[str, Any]], _Flight] = {}
    finished = len(study.finished())
    while finished < trials:
        while len(flights) < min(jobs, trials - finished):
            flight = _Flight(*study.propose())
            flights[executor.submit(run_trial, flight.recipe)] = flight
        ended, _ = wait(flights, timeout=QUIET, return_when=FIRST_COMPLETED)
        if not ended and on_quiet is not None:
            on_quiet()
        for future in ended:
            flight = flights.pop(future)
            result = _result(future, flight)
            if result is None:
                flights[executor.submit(run_trial, flight.recipe)] = flight
                continue
            study.tell(flight.number, result)
            finished += 1
            if on_trial is not None:
                on_trial(result)


def _result(future: Future[dict[str, Any]], flight: _Flight) -> dict[str, Any] | None:
    """What a trial gave, or None where its worker was lost."""
    try:
        return future.result()
    except Exception as error:
        if not is_lost_worker(error):
            raise
        flight.losses += 1
        if flight.losses >= MOST_LOSSES:
            raise DiceError(
                f"trial {flight.number}: expected workers that stay, but it was running when "
                f"workers were lost {flight.losses} times; see whether memory suffices or take "
                "fewer --jobs, and run the same command to go on with other trials"
            ) from error
        return None
