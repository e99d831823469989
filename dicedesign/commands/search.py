"""`dicedesign search`: many dice of one recipe, for one that prints and rolls better."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.errors import InputError

if TYPE_CHECKING:
    from dicedesign.recipe import Recipe

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "search",
        help="search for a die that prints and rolls better",
        description="Design many dice of one recipe, with other seeds, assignments of labels and "
        "weights of preferences, and rank them by the smallest circle in a labelled facet and the "
        "momentum margin. The same command goes on where an earlier one ended. Needs the extra "
        "'search'; --scheduler needs 'cluster'.",
    )
    parser.add_argument("recipe", type=Path, metavar="RECIPE", help="YAML file")
    parser.add_argument(
        "--trials",
        type=int,
        required=True,
        metavar="N",
        help="how many dice are to be tried in all, those already in the folder included",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        metavar="J",
        help="how many at a time (default: one for each core, or each thread of the cluster); 1 "
        "makes the search repeatable",
    )
    parser.add_argument(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help="run on the Dask cluster of this address (default: on this machine)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: outputs/NAME_search)",
    )
    parser.set_defaults(command=_search)


def _search(options: argparse.Namespace) -> int:
    from dicedesign.design_stage import make_start
    from dicedesign.recipe_file import read_recipe
    from dicedesign.search.leaderboard import write_results
    from dicedesign.search.study import open_study

    for name in ("trials", "jobs"):
        value = getattr(options, name)
        if value is not None and value < 1:
            raise InputError(f"--{name}: expected a whole number above 0, got {value}; raise it")
    if options.scheduler is not None and "://" not in options.scheduler:
        raise InputError(
            "--scheduler: expected an address such as tcp://10.0.0.5:8786, got "
            f"{options.scheduler!r}; the scheduler prints its own when it starts"
        )
    recipe = read_recipe(options.recipe)
    # A start that does not suit the target suits it in no trial.
    make_start(recipe)
    folder = options.out or Path("outputs") / f"{recipe.name}_search"
    with open_study(folder, recipe) as study:
        before = len(study.finished())
        if before < options.trials:
            _run(study, options)
        finished = study.finished()
        board = write_results(folder, recipe, finished)
    if before:
        print(f"note: {before} trials were already in {folder}", file=sys.stderr)
    _print(recipe, folder, finished, board)
    return 0 if board else 1


def _run(study: Any, options: argparse.Namespace) -> None:
    from tqdm import tqdm

    from dicedesign.search.executors import cluster_workers, local_workers, no_worker_left
    from dicedesign.search.running import run_search

    with contextlib.ExitStack() as stack:
        if options.scheduler is None:
            jobs = options.jobs or os.cpu_count() or 1
            executor = stack.enter_context(local_workers(jobs))
        else:
            executor, threads = stack.enter_context(cluster_workers(options.scheduler))
            jobs = options.jobs or threads
        finished = study.finished()
        bar = stack.enter_context(
            tqdm(
                file=sys.stderr,
                disable=not sys.stderr.isatty(),
                unit=" trials",
                total=options.trials,
                initial=len(finished),
            )
        )
        converged, told = sum(trial["status"] == "converged" for trial in finished), False

        def on_trial(result: dict[str, Any]) -> None:
            nonlocal converged, told
            told = False
            converged += result["status"] == "converged"
            bar.set_postfix_str(f"{converged} converged", refresh=False)
            bar.update()

        def on_quiet() -> None:
            nonlocal told
            if not told and no_worker_left(executor):
                told = True
                note = f"note: {options.scheduler} has no worker left; trials wait for one to join"
                bar.write(note, file=sys.stderr)

        run_search(study, options.trials, executor, jobs, on_trial=on_trial, on_quiet=on_quiet)


def _print(
    recipe: Recipe, folder: Path, finished: Sequence[dict[str, Any]], board: list[dict[str, Any]]
) -> None:
    converged = sum(trial["status"] == "converged" for trial in finished)
    print(f"{recipe.name}: {converged} of {len(finished)} trials converged")
    if board:
        print("rank  trial  radius mm  margin deg  max |p - q|  asymmetry  front")
    for entry in board:
        print(
            f"{entry['rank']:>4}  {entry['number']:>5}  {entry['inradius_mm']:>9.3f}  "
            f"{entry['margin_deg']:>10.3f}  {entry['max_abs_error']:>11.1e}  "
            f"{entry['asymmetry']:>9.4f}  {'yes' if entry['on_front'] else ''}".rstrip()
        )
    written = ["leaderboard.html", "leaderboard.json", "leaderboard.csv", "pareto.png"]
    if board:
        written += ["best.yaml", "trial_N.yaml of those above"]
    print(f"files in {folder}: {', '.join(written)}")
