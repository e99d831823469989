"""`dicedesign run`, `design`, `search` and `view`: dice from recipes and from the command line."""

from __future__ import annotations

import argparse
import dataclasses
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.options import (
    add_worker_options,
    check_worker_options,
    note_missing_kernels,
    workers_of,
)
from dicedesign.errors import InputError, RecipeError, check_whole, named
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from dicedesign.fabricate.printers import PrintOptions
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.results.parts import RoundOfThrows
    from dicedesign.results.result import Result, Step
    from dicedesign.search.study import SearchStudy


def add_result_options(parser: Any) -> None:
    """Add the options of what is written to an argparse parser."""
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results (default: outputs/NAME)"
    )
    parser.add_argument(
        "--files",
        type=lambda text: [name.strip() for name in text.split(",")],
        metavar="FORMATS",
        help="formats of the die beside STL, such as 3mf,obj,glb",
    )
    parser.add_argument(
        "--data-sheet", action="store_true", help="add a page to print, as PDF and PNG"
    )
    parser.add_argument(
        "--printer",
        metavar="NAME",
        help="judge how the die prints by the limits of fdm (filament), sla (resin) or sls "
        "(powder), and write die_oriented.stl, which lies on the bed as is best",
    )
    parser.add_argument(
        "--no-figures", action="store_true", help="leave out the pictures and the page"
    )
    parser.add_argument(
        "--no-clock",
        action="store_true",
        help="leave out run times and memory, so that two runs can be compared byte by byte",
    )


def with_result_options(recipe: Recipe, options: argparse.Namespace) -> Recipe:
    """The recipe as the options change it. Raises InputError for an unknown format or printer."""
    from dicedesign.fabricate.file_formats import with_stl

    changes: dict[str, Any] = {}
    if options.files:
        changes |= {"files": with_stl(options.files, "--files")}
    if options.data_sheet:
        changes |= {"data_sheet": True}
    if options.printer is not None:
        with named("--printer"):
            changes["print"] = _with_printer(recipe, options.printer)
    if options.no_figures:
        changes |= {"figures": False, "report": False}
    if options.no_clock:
        changes |= {"clock": False}
    return recipe.model_copy(update=changes)


def _with_printer(recipe: Recipe, name: str) -> PrintOptions:
    """The recipe's options of printing where they are for this printer, else its usual ones with
    the recipe's infill and errors."""
    from dicedesign.fabricate.printers import PrintOptions

    if recipe.print is not None and recipe.print.printer == name:
        return dataclasses.replace(recipe.print, oriented=True)
    asked = recipe.print or PrintOptions()
    return PrintOptions(
        printer=name,
        oriented=True,
        infill=asked.infill,
        walls_mm=asked.walls_mm,
        errors=asked.errors,
    )


def run_and_print(
    recipe: Recipe, out: Path | None, *, enlarge: bool = False, resume: bool = False
) -> int:
    """Run a recipe into a folder, None for outputs/NAME, and print what came of it.

    Progress and notes go to stderr. Arguments and errors are those of `run`.
    Returns the exit code: 0 converged, 1 not.
    """
    from tqdm import tqdm

    from dicedesign.recipe.pipeline import Listeners, run

    note_missing_kernels()
    with tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=" steps") as bar:

        def on_step(step: Step) -> None:
            bar.update()
            error = "" if step.max_abs_error is None else f"max |p - q| {step.max_abs_error:.2e}"
            if step.attempt is not None:
                place = f"attempt {step.attempt}, {step.stage}"
                error = f"{place}, {error}" if error else place
            bar.set_postfix_str(error)

        def on_round(thrown: RoundOfThrows) -> None:
            told = f"{thrown.drops} throws, total variation {thrown.deviation:.3f}"
            bar.set_description_str(f"{told} (perfect {thrown.noise_floor:.3f})")

        told = bar.set_description_str
        listeners = Listeners(told, on_step, on_round, told)
        result = run(recipe, out, enlarge=enlarge, resume=resume, listeners=listeners)
    for note in result.notes:
        print(f"note: {note}", file=sys.stderr)
    _print(result)
    return 0 if result.converged else 1


def _print(result: Result) -> None:
    print(f"{result.name}: {result.status} ({result.message})")
    _print_odds(result)
    if result.concave is not None:
        moved = result.concave.displacement
        print(
            f"displacement: mean {100.0 * moved.mean:.3g} %, largest "
            f"{100.0 * moved.largest:.3g} % of the diagonal"
        )
        print(
            f"outcomes: {result.least_angle_deg:.3g} degrees apart or more, left at "
            f"{result.least_margin_deg:.3g} degrees or more"
        )
    printed = result.engraved
    if printed is not None and printed.max_abs_error is not None and result.thrown is None:
        told = f"as printed: max |p - q| {printed.max_abs_error:.2e}"
        if printed.balance is not None and len(printed.balance.errors) > 1:
            told += f", {printed.balance.errors[0]:.2e} before the shape was moved"
        print(told)
    if result.tolerances is not None:
        print(result.tolerances.answer)
    print(f"files in {printable(result.folder)}: {', '.join(result.files.values())}")


def _print_odds(result: Result) -> None:
    """Target and odds by label; of a thrown die those that it was designed for and seen with, of
    one that keeps the shape of a surface those of all other rests too."""
    odds: dict[str, Sequence[float]] = {"achieved": result.probabilities}
    if result.thrown is not None:
        odds = {"set down": result.probabilities, "model": result.thrown.momentum}
        if result.thrown.simulated is not None:
            odds["thrown"] = result.thrown.simulated.frequencies
    rows = list(zip(result.labels, result.target, *odds.values(), strict=True))
    if result.concave is not None:
        rows.append(("other", 0.0, result.elsewhere))
    columns = [("label", ">"), *((name, "#.5g") for name in ("target", *odds))]
    print("\n".join(text_table(columns, rows)))


def add_run_parser(commands: Any) -> None:
    """Add `dicedesign run` to argparse's `commands`."""
    parser = commands.add_parser(
        "run",
        help="turn a recipe into a printable die",
        description="Turn a YAML recipe into an engraved, printable die with a report.",
    )
    parser.add_argument("recipe", type=Path, metavar="RECIPE", help="YAML file")
    add_result_options(parser)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="key=value",
        dest="changes",
        help="change an entry of the recipe, such as size_mm=40 or method.exact.tolerance=1e-9",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on from the checkpoint of a concave die that an interrupted run left in the "
        "folder",
    )
    parser.set_defaults(command=_run_recipe)


def _run_recipe(options: argparse.Namespace) -> int:
    from dicedesign.recipe.reading import read_recipe

    recipe = with_result_options(read_recipe(options.recipe, options.changes), options)
    return run_and_print(recipe, options.out, resume=options.resume)


OPTION_OF_KEY: Final = (
    (r"target(: |\.)(probabilities|fair|binomial|sum_of_dice)(\.\d+)?", "--target"),
    (r"target(: |\.)labels(\.\d+)?", "--labels"),
    (r"target", "--target"),
    (r"name", "--name"),
    (r"seed", "--seed"),
    (r"size_mm", "--size-mm"),
    (r"start\.mesh(\.path)?", "--mesh"),
)
"""How an error about an entry of the recipe begins, as a regular expression, and the option that
the entry came from."""


def add_design_parser(commands: Any) -> None:
    """Add `dicedesign design` to argparse's `commands`."""
    parser = commands.add_parser(
        "design",
        help="turn probabilities into a printable die",
        description="Turn probabilities into an engraved, printable die with a report. The shape "
        "is found alone, or is that of a mesh, bent a little (--mesh); the recipe is written "
        "beside the die.",
    )
    parser.add_argument(
        "--target",
        required=True,
        metavar="p,q,...",
        help="probabilities that sum to 1, fractions or decimals, such as 1/2,1/3,1/6; or what a "
        "recipe says, such as 'fair: 7' or 'sum_of_dice: [6, 6]'",
    )
    parser.add_argument(
        "--labels", metavar="a,b,...", help="a label for each of them (default: 1,2,...)"
    )
    parser.add_argument(
        "--mesh",
        metavar="FILE",
        help="bend this closed surface (OBJ, STL, ...) until it is a die, and keep its shape as "
        "far as can be",
    )
    parser.add_argument(
        "--repair",
        action="store_true",
        help="make the mesh the closed surface of one solid first, where it is none",
    )
    add_result_options(parser)
    parser.add_argument("--name", default="die", help="name of the die (default: die)")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="another seed gives another shape"
    )
    parser.add_argument(
        "--size-mm",
        type=float,
        metavar="X",
        help="largest distance between two corners (default: 30, or as much as the labels need, "
        "and 30 with --mesh)",
    )
    parser.set_defaults(command=_design)


def _design(options: argparse.Namespace) -> int:
    from dicedesign.recipe.reading import checked_recipe, typed_target

    with _named_options():
        target = typed_target(options.target, options.labels)
    if options.repair and options.mesh is None:
        raise InputError("--repair: expected --mesh FILE with it, got none; add it")
    entries: dict[str, Any] = {
        "name": options.name,
        "seed": options.seed,
        "target": target,
        "start": {"search": {}},
        "method": {"exact": {}},
    }
    if options.mesh is not None:
        entries["start"] = {"mesh": {"path": options.mesh, "repair": options.repair}}
        entries["method"] = {"concave": {}}
    if options.size_mm is not None:
        entries["size_mm"] = options.size_mm
    with _named_options():
        recipe = checked_recipe(entries)
    recipe = with_result_options(recipe, options)
    return run_and_print(
        recipe, options.out, enlarge=options.size_mm is None and options.mesh is None
    )


@contextmanager
def _named_options() -> Iterator[None]:
    """Makes messages about entries of the recipe such about the options that they came from."""
    try:
        yield
    except RecipeError as error:
        message = str(error)
        for key, option in OPTION_OF_KEY:
            message = re.sub(rf"^{key}(?=: )", option, message)
        raise RecipeError(message) from error


def add_search_parser(commands: Any) -> None:
    """Add `dicedesign search` to argparse's `commands`."""
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
            _run_trials(study, options)
        finished = study.finished()
        board = write_results(folder, recipe, finished)
    if before:
        print(f"note: {before} trials were already in {printable(folder)}", file=sys.stderr)
    _print_board(recipe, folder, finished, board)
    return 0 if board else 1


def _run_trials(study: SearchStudy, options: argparse.Namespace) -> None:
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


def _print_board(
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


def add_view_parser(commands: Any) -> None:
    """Add `dicedesign view` to argparse's `commands`."""
    parser = commands.add_parser(
        "view",
        help="look at a body or a die in the browser, drag it, design one",
        description="Open a page in the browser: the body, its hull, where it comes to rest and "
        "how often. Drag the center of mass, a corner or a facet, and all of it follows. Needs the "
        "extra 'view'. Ends with Ctrl-C.",
    )
    parser.add_argument(
        "path",
        type=Path,
        nargs="?",
        metavar="MESH|RECIPE|FOLDER",
        help="a mesh; a recipe, which is designed; the folder of a finished die, or one of meshes "
        "(default: a page on which to design a die)",
    )
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="who can open the page: 127.0.0.1, this machine alone; 0.0.0.0, every machine that "
        "reaches it and knows the address, which then has a secret word (default: 127.0.0.1)",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=8080,
        metavar="N",
        help="port of the page, 0 for any that is free (default: 8080)",
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address and open no browser"
    )
    parser.set_defaults(command=_view)


def _view(options: argparse.Namespace) -> int:
    # Imported here, as other commands do without.
    from dicedesign.view.application import serve_view

    def told(address: str) -> None:
        print(address, flush=True)

    serve_view(options.path, options.host, options.port, browser=not options.no_browser, told=told)
    return 0
