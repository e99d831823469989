"""Running a recipe from the command line: progress, notes, the table of odds and the exit code."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.options import note_missing_kernels
from dicedesign.errors import named
from dicedesign.runtime.text import printable, text_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dicedesign.fabricate.print_options import PrintOptions
    from dicedesign.optimize.refinement.rounds import Round
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.results.result import Result, Step

__all__ = ["add_result_options", "run_and_print", "with_result_options"]


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
    from dicedesign.fabricate.print_options import PrintOptions

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

    from dicedesign.recipe.pipeline import run
    from dicedesign.recipe.work import Listeners

    note_missing_kernels()
    with tqdm(file=sys.stderr, disable=not sys.stderr.isatty(), unit=" steps") as bar:

        def on_step(step: Step) -> None:
            bar.update()
            error = "" if step.max_abs_error is None else f"max |p - q| {step.max_abs_error:.2e}"
            if step.attempt is not None:
                place = f"attempt {step.attempt}, {step.stage}"
                error = f"{place}, {error}" if error else place
            bar.set_postfix_str(error)

        def on_round(thrown: Round) -> None:
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
