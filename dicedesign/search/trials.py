"""Trials of a search, one or many: a recipe in, what its die is like out, both as plain data."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

from dicedesign.errors import DiceError, NoStartError, OutsideHullError
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.reading import parse_recipe
from dicedesign.runtime.workers import MOST_LOSSES, is_lost_worker, iterate_completed
from dicedesign.search.study import SearchStudy

NO_DIE = "NO_DIE"
"""Beside the names of `Status`: there is no die that has a facet for each outcome."""


def run_trial(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Design the die of a recipe and measure it; nothing is engraved or written.

    entries: the recipe as plain data, as in `parse_recipe`.

    Returns plain data: "status" as in result.json, or "no_die"; "message"; "max_abs_error";
    "inradius_mm", radius of the smallest of the largest circles in the outcomes' facets, and
    "margin_deg", the least angle from an outcome's facet normal to the border of its basin, both
    None where an outcome has no facet; "asymmetry" (eq. 20); "vertices" (n, 3) in mm; "down" (3,),
    the most probable direction; "seconds". Where the start leads nowhere, all but the texts and the
    seconds are None.

    Raises InputError where no other seed would help: a mesh that cannot be read here, say.
    """
    recipe, started = parse_recipe(entries), time.perf_counter()
    try:
        work = design_recipe(recipe, last="check")
    except (NoStartError, OutsideHullError) as error:
        # The start depends on the seed, and so does whether a given center is inside.
        measured = dict.fromkeys(
            ("max_abs_error", "inradius_mm", "margin_deg", "asymmetry", "vertices", "down")
        )
        result = {"status": NO_DIE.lower(), "message": str(error), **measured}
    else:
        die = work.result()
        shown = [facet for facet in die.facets if facet.label is not None]
        is_complete = len(shown) == len(die.labels)
        # A tolerance above an outcome's probability is met without it.
        is_usable = is_complete or not die.converged
        result = {
            "status": die.status if is_usable else NO_DIE.lower(),
            "message": die.message,
            "max_abs_error": die.design.max_abs_error,
            "inradius_mm": min(facet.inradius_mm for facet in shown) if is_complete else None,
            "margin_deg": min(facet.border_deg for facet in shown) if is_complete else None,
            "asymmetry": die.asymmetry,
            "vertices": work.solid.points.tolist(),
            "down": list(die.facets[0].normal),
        }
    return {**result, "seconds": time.perf_counter() - started}


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
) -> None:
    """Run trials until the study has the wanted number of finished ones.

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

    for trial, future in iterate_completed(next_trial, submit, jobs):
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
