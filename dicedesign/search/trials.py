"""Trials of a search: design the die of a recipe and measure it, one or many at a time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

from dicedesign.errors import DiceError, NoStartError, OutsideHullError
from dicedesign.recipe.design_die import design_recipe
from dicedesign.recipe.reading import parse_recipe
from dicedesign.results.result import Result
from dicedesign.runtime.workers import MOST_LOSSES, is_lost_worker, iterate_completed
from dicedesign.search.study import SearchStudy

NO_DIE = "NO_DIE"
"""Status besides the names of `Status`: no die has a facet for each outcome."""


def run_trial(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Design the die of a recipe and measure it; nothing is engraved or written.

    entries: recipe as plain data, as in `parse_recipe`.

    Returns plain data: "status" as in result.json, or "no_die"; "message"; "max_abs_error";
    "inradius_mm", the smallest inradius of the outcomes' facets, and "margin_deg", the least angle
    from an outcome's facet normal to the border of its basin, both None if an outcome has no facet;
    "asymmetry" (eq. 20); "vertices" (n, 3) in mm; "down" (3,), the most probable direction;
    "seconds". If no start leads to a die, all but the texts and the seconds are None.

    Raises InputError if another seed would not help, such as for an unreadable mesh.
    """
    recipe, started = parse_recipe(entries), time.perf_counter()
    try:
        work = design_recipe(recipe, last="check")
    except (NoStartError, OutsideHullError) as error:
        # The start, and whether a given center is inside, depend on the seed.
        measured = dict.fromkeys(
            ("max_abs_error", "inradius_mm", "margin_deg", "asymmetry", "vertices", "down")
        )
        result = {"status": NO_DIE.lower(), "message": str(error), **measured}
    else:
        die = work.result()
        room = measure_facets(die, len(work.target.face_labels))
        # With a tolerance above an outcome's probability, a die converges without it.
        is_usable = room["inradius_mm"] is not None or not die.converged
        result = {
            "status": die.status if is_usable else NO_DIE.lower(),
            "message": die.message,
            "max_abs_error": die.design.max_abs_error,
            **room,
            "asymmetry": die.asymmetry,
            "vertices": work.solid.points.tolist(),
            "down": list(die.facets[0].normal),
        }
    return {**result, "seconds": time.perf_counter() - started}


def measure_facets(die: Result, faces: int) -> dict[str, float | None]:
    """Smallest "inradius_mm" of the labeled facets of a die, and smallest "margin_deg", the angle
    from a labeled facet's normal to the border of its basin; both None if a label has no facet.

    faces: number of labels.
    """
    shown = [facet for facet in die.facets if facet.label is not None]
    if len(shown) != faces:
        return {"inradius_mm": None, "margin_deg": None}
    return {
        "inradius_mm": min(facet.inradius_mm for facet in shown),
        "margin_deg": min(facet.border_deg for facet in shown),
    }


@dataclass
class _Trial:
    """Running trial.

    Attributes
    ----------
    number: number in the search.
    recipe: recipe as plain data.
    losses: lost workers so far. A local worker that dies ends all running trials.
    """

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
    """Run trials until the study has a number of finished ones.

    Each result is saved before the next trial starts. Trials whose worker is lost, or that an
    earlier search left unfinished, run again. With one job, a recipe always gives identical
    trials, also after interrupts; with several, the trials depend on the order in which they end.

    Parameters
    ----------
    study: see `open_study`.
    trials: number of finished trials at the end, including earlier searches.
    executor: processes or machines that can import this package.
    jobs: number of trials at a time, at least 1.
    on_trial: called with each saved result.

    Raises
    ------
    DiceError: a trial cannot run, and runs again in the next search; or workers are lost repeatedly
        while it runs, and it is abandoned, as after an unexpected error.
    OutputError: a result cannot be saved.
    """
    count = len(study.finished())
    lost: list[_Trial] = []

    def next_trial() -> _Trial | None:
        nonlocal count
        if lost:
            return lost.pop()
        if count >= trials:
            return None
        count += 1
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
                study.abandon(trial.number)
                raise
            trial.losses += 1
            if trial.losses >= MOST_LOSSES:
                study.abandon(trial.number)
                raise DiceError(
                    f"trial {trial.number}: expected workers that stay, but it was running when "
                    f"workers were lost {trial.losses} times; see whether memory suffices or take "
                    "fewer --jobs, and repeat the command to continue with other trials"
                ) from error
            lost.append(trial)
        else:
            study.tell(trial.number, result)
            if on_trial is not None:
                on_trial(result)
