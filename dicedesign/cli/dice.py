"""`dicedesign run`, `design`, `search` and `view`: dice from recipes and from the command line."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dicedesign.cli.commands import Design, Run, Search, View, WithResults
from dicedesign.cli.options import (
    check_worker_options,
    note_missing_kernels,
    print_note,
    text_table,
    workers_of,
)
from dicedesign.errors import InputError, RecipeError, check_whole, named, printable
from dicedesign.recipe.reading import parse_recipe, parse_target, read_recipe

if TYPE_CHECKING:
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.results.parts import RoundOfThrows
    from dicedesign.results.result import Result, Step

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


def run_recipe(options: Run) -> int:
    """Make the die of a recipe."""
    return _run(read_recipe(options.recipe, options.set), options, resume=options.resume)


def design(options: Design) -> int:
    """Make the die of some probabilities."""
    with _named_options():
        target = parse_target(options.target, options.labels)
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
        recipe = parse_recipe(entries)
    return _run(recipe, options, enlarge=options.size_mm is None and options.mesh is None)


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


def _run(
    recipe: Recipe, options: WithResults, *, enlarge: bool = False, resume: bool = False
) -> int:
    """Run a recipe as the options change it, and print what came of it. Returns the exit code: 0
    converged, 1 not.

    Raises InputError for an unknown format or printer, and as `run`.
    """
    recipe = _with_options(recipe, options)
    # Imported here, as a recipe that cannot be read does without.
    from dicedesign.recipe.pipeline import Callbacks, run
    from dicedesign.runtime.workers import progress_bar

    note_missing_kernels()
    with progress_bar("steps") as bar:

        def on_step(step: Step) -> None:
            bar.update()
            parts = [] if step.attempt is None else [f"attempt {step.attempt}, {step.stage}"]
            if step.max_abs_error is not None:
                parts.append(f"max |p - q| {step.max_abs_error:.2e}")
            bar.set_postfix_str(", ".join(parts))

        def on_round(thrown: RoundOfThrows) -> None:
            bar.set_description_str(
                f"{thrown.drops} throws, total variation {thrown.deviation:.3f} "
                f"(perfect {thrown.noise_floor:.3f})"
            )

        describe = bar.set_description_str
        callbacks = Callbacks(describe, on_step, on_round, describe)
        result = run(recipe, options.out, enlarge=enlarge, resume=resume, callbacks=callbacks)
    for note in result.notes:
        print_note(note)
    _print_result(result)
    return 0 if result.converged else 1


def _with_options(recipe: Recipe, options: WithResults) -> Recipe:
    from dicedesign.fabricate.file_formats import with_stl
    from dicedesign.fabricate.printers import PrintOptions

    changes: dict[str, Any] = {}
    if options.files is not None:
        names = [name.strip() for name in options.files.split(",")]
        changes["files"] = with_stl(names, "--files")
    if options.data_sheet:
        changes["data_sheet"] = True
    if options.printer is not None:
        with named("--printer"):
            asked = recipe.print or PrintOptions()
            if asked.printer != options.printer:
                # Limits of the recipe's printer are none of another.
                asked = PrintOptions(
                    options.printer,
                    infill=asked.infill,
                    walls_mm=asked.walls_mm,
                    errors=asked.errors,
                )
            changes["print"] = dataclasses.replace(asked, oriented=True)
    if options.no_figures:
        changes |= {"figures": False, "report": False}
    if options.no_clock:
        changes["clock"] = False
    return recipe.model_copy(update=changes)


def _print_result(result: Result) -> None:
    """Print target and probabilities by label, of a thrown die those that it was designed for and
    seen with, of one that keeps the shape of a surface those of all other rests too; and what was
    written."""
    print(f"{result.name}: {result.status} ({result.message})")
    probabilities: dict[str, Sequence[float]] = {
        "target": result.target,
        "achieved": result.probabilities,
    }
    if result.thrown is not None:
        probabilities = {
            "target": result.target,
            "set down": result.probabilities,
            "model": result.thrown.momentum,
        }
        if result.thrown.simulated is not None:
            probabilities["thrown"] = result.thrown.simulated.frequencies
    labels = list(result.labels)
    if result.concave is not None:
        labels.append("other")
        probabilities = {
            "target": (*result.target, 0.0),
            "achieved": (*result.probabilities, result.elsewhere),
        }
    print(
        text_table(
            ("label", ">", labels), *((name, "#.5g", p) for name, p in probabilities.items())
        )
    )
    if result.concave is not None:
        moved = result.concave.displacement
        print(
            f"displacement: mean {100.0 * moved.mean:.3g} %, largest "
            f"{100.0 * moved.largest:.3g} % of the diagonal\n"
            f"outcomes: {result.least_angle_deg:.3g} degrees apart or more, left at "
            f"{result.least_margin_deg:.3g} degrees or more"
        )
    printed = result.engraved
    if printed is not None and printed.max_abs_error is not None and result.thrown is None:
        line = f"as printed: max |p - q| {printed.max_abs_error:.2e}"
        if printed.balance is not None and len(printed.balance.errors) > 1:
            line += f", {printed.balance.errors[0]:.2e} before the shape was moved"
        print(line)
    if result.tolerances is not None:
        print(result.tolerances.answer)
    print(f"files in {printable(result.folder)}: {', '.join(result.files.values())}")


def search(options: Search) -> int:
    """Design many dice of one recipe, and print the best."""
    from dicedesign.recipe.design_die import design_recipe
    from dicedesign.search.leaderboard import write_results
    from dicedesign.search.study import open_study
    from dicedesign.search.trials import run_search

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
        finished = study.finished()
        before, converged = len(finished), _converged(finished)
        if before < options.trials:
            with workers_of(options, "trials", options.trials, before) as workers:

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
            finished = study.finished()
        board = write_results(folder, recipe, finished)
    if before:
        print_note(f"{before} trials were already in {printable(folder)}")
    print(f"{recipe.name}: {_converged(finished)} of {len(finished)} trials converged")
    written = ["leaderboard.html", "leaderboard.json", "leaderboard.csv", "pareto.png"]
    if board:
        columns = (
            ("rank", "d", "rank"),
            ("trial", "d", "number"),
            ("radius mm", ".3f", "inradius_mm"),
            ("margin deg", ".3f", "margin_deg"),
            ("max |p - q|", ".1e", "max_abs_error"),
            ("asymmetry", ".4f", "asymmetry"),
        )
        values = [(name, form, [entry[key] for entry in board]) for name, form, key in columns]
        print(text_table(*values, ("front", "", ["yes" * entry["on_front"] for entry in board])))
        written += ["best.yaml", "trial_N.yaml of those above"]
    print(f"files in {printable(folder)}: {', '.join(written)}")
    return 0 if board else 1


def _converged(trials: Sequence[dict[str, Any]]) -> int:
    return sum(trial["status"] == "converged" for trial in trials)


def view(options: View) -> int:
    """Serve a page."""
    from dicedesign.view.application import serve_view

    serve_view(
        options.path,
        options.host,
        options.port,
        browser=not options.no_browser,
        told=lambda address: print(address, flush=True),
    )
    return 0
