"""A search: trials are proposed, run side by side, and remembered."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

from dicedesign.errors import DiceError
from dicedesign.runtime.workers import MOST_LOSSES, as_ended, is_lost_worker
from dicedesign.search.study import SearchStudy
from dicedesign.search.trial import run_trial

__all__ = ["run_search"]


@dataclass
class _Trial:
    """One that runs: its number, its recipe, and how often a worker was lost meanwhile. Not every
    such trial is to blame: a local worker that is lost takes down all that run beside it."""

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

    Each result is kept before the next trial begins. A trial whose worker was lost, or that was cut
    off when the search ended, runs again. With one job the same recipe gives the same trials, ended
    and begun again wherever it may be; with several it matters which end first.

    Parameters
    ----------
    study: see `open_study`.
    trials: how many are to be finished at the end, those of earlier searches included.
    executor: runs them; processes or machines that can import this package.
    jobs: how many run at a time, at least 1.
    on_trial: called with each result once it is kept.
    on_quiet: called whenever no trial has ended for some seconds.

    Raises
    ------
    DiceError: a trial cannot be run, and comes again in the next search; or workers are lost again
        and again while it runs: that one is given up, as is one that fails for a reason that nobody
        foresaw.
    OutputError: a result cannot be kept.
    """
    begun = len(study.finished())
    lost: list[_Trial] = []

    def next_trial() -> _Trial | None:
        nonlocal begun
        if lost:
            return lost.pop()
        if begun >= trials:
            return None
        begun += 1
        return _Trial(*study.propose())

    def submit(trial: _Trial) -> Future[dict[str, Any]]:
        return executor.submit(run_trial, trial.recipe)

    for trial, future in as_ended(next_trial, submit, jobs, on_quiet):
        try:
            result = future.result()
        except DiceError:
            raise
        except Exception as error:
            if not is_lost_worker(error):
                study.give_up(trial.number)
                raise
            trial.losses += 1
            if trial.losses >= MOST_LOSSES:
                study.give_up(trial.number)
                raise DiceError(
                    f"trial {trial.number}: expected workers that stay, but it was running when "
                    f"workers were lost {trial.losses} times; see whether memory suffices or take "
                    "fewer --jobs, and run the same command to go on with other trials"
                ) from error
            lost.append(trial)
        else:
            study.tell(trial.number, result)
            if on_trial is not None:
                on_trial(result)
