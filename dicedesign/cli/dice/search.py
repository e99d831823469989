"""`dicedesign search`: many dice of one recipe, for one that prints and rolls better."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.options import add_worker_options, check_worker_options, workers_of
from dicedesign.errors import InputError
from dicedesign.runtime.checks import check_whole
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.search.study import SearchStudy

__all__ = ["add_parser"]


def add_parser(commands: Any) -> None:
    """Add the subcommand to argparse's `commands`."""
    parser = commands.add_parser(
        "search",
        help="search for a die that prints and rolls better",
        description="Design many dice of one recipe, with other seeds, assignments of labels and "
        "weights of preferences, and rank them by the smallest circle in a labelled facet and the "
        "momentum margin. The same command goes on where an earlier one ended or was killed. Needs "
        "the extra 'search'; --scheduler needs 'cluster'.",
    )
    parser.add_argument("recipe", type=Path, metavar="RECIPE", help="YAML file")
    parser.add_argument(
        "--trials",
        type=int,
        required=True,
        metavar="N",
        help="how many dice are to be tried in all, those already in the folder included",
    )
    add_worker_options(
        parser,
        "how many at a time (default: one for each core, or each thread of the cluster); 1 makes "
        "the search repeatable",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: outputs/NAME_search)",
    )
    parser.set_defaults(command=_search)


def _search(options: argparse.Namespace) -> int:
    from dicedesign.recipe.design_die import design_recipe
    from dicedesign.recipe.reading import read_recipe
    from dicedesign.search.leaderboard import write_results
    from dicedesign.search.study import open_study

    check_whole("--trials", options.trials)
    check_worker_options(options)
    recipe = read_recipe(options.recipe)
    if recipe.method.exact is not None and recipe.method.exact.refine is not None:
        raise InputError(
            f"{options.recipe}: expected no method.exact.refine in a search, whose trials take "
            "seconds, got one; leave it out, and add it to the best recipe found"
        )
    if recipe.method.concave is not None:
        raise InputError(
            f"{options.recipe}: expected a method for convex dice in a search, got concave; such a "
            "recipe is for dicedesign run alone, which searches itself"
        )
    # A start that does not suit the target suits it in no trial.
    design_recipe(recipe, last="start")
    folder = options.out or Path("outputs") / f"{recipe.name}_search"
    with open_study(folder, recipe) as study:
        before = len(study.finished())
        if before < options.trials:
            _run(study, options)
        finished = study.finished()
        board = write_results(folder, recipe, finished)
    if before:
        print(f"note: {before} trials were already in {printable(folder)}", file=sys.stderr)
    _print(recipe, folder, finished, board)
    return 0 if board else 1


def _run(study: SearchStudy, options: argparse.Namespace) -> None:
    from dicedesign.search.trials import run_search

    finished = study.finished()
    converged = sum(trial["status"] == "converged" for trial in finished)
    with workers_of(options, "trials", options.trials, len(finished)) as workers:

        def on_trial(result: dict[str, Any]) -> None:
            nonlocal converged
            converged += result["status"] == "converged"
            workers.bar.set_postfix_str(f"{converged} converged", refresh=False)
            workers.advance(1)

        run_search(
            study,
            options.trials,
            workers.executor,
            workers.jobs,
            on_trial=on_trial,
            on_quiet=workers.on_quiet,
        )


def _print(
    recipe: Recipe, folder: Path, finished: Sequence[dict[str, Any]], board: list[dict[str, Any]]
) -> None:
    converged = sum(trial["status"] == "converged" for trial in finished)
    print(f"{recipe.name}: {converged} of {len(finished)} trials converged")
    if board:
        columns = [("rank", "d"), ("trial", "d"), ("radius mm", ".3f"), ("margin deg", ".3f")]
        columns += [("max |p - q|", ".1e"), ("asymmetry", ".4f"), ("front", "")]
        keys = ("rank", "number", "inradius_mm", "margin_deg", "max_abs_error", "asymmetry")
        rows = (
            [*(entry[key] for key in keys), "yes" if entry["on_front"] else ""] for entry in board
        )
        print("\n".join(text_table(columns, rows)))
    written = ["leaderboard.html", "leaderboard.json", "leaderboard.csv", "pareto.png"]
    if board:
        written += ["best.yaml", "trial_N.yaml of those above"]
    print(f"files in {printable(folder)}: {', '.join(written)}")
