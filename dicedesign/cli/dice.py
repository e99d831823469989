"""`dicedesign run`, `design`, `set`, `sweep` and `view`."""

from __future__ import annotations

import dataclasses
import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.cli.commands import (
    DesignArguments,
    RunArguments,
    SetArguments,
    SweepArguments,
    ViewArguments,
    WithResults,
)
from dicedesign.cli.options import (
    note_missing_kernels,
    print_notes,
    text_table,
    workers_of,
)
from dicedesign.errors import InputError, check_whole, named, printable
from dicedesign.recipe.reading import (
    parse_recipe,
    parse_target,
    read_recipe,
    resolve_paths,
    split_texts,
)

if TYPE_CHECKING:
    from dicedesign.recipe.recipe import Recipe
    from dicedesign.results.parts import Candidate, RoundOfThrows
    from dicedesign.results.result import Result, Step

OPTION_OF_KEY = (
    (r"target(: |\.)(probabilities|fair|binomial|sum_of_dice)(\.\d+)?", "--target"),
    (r"target(: |\.)labels(\.\d+)?", "--labels"),
    (r"target", "--target"),
    (r"name", "--name"),
    (r"seed", "--seed"),
    (r"size_mm", "--size-mm"),
    (r"engrave\.icons(\.[^:]*)?", "--icons"),
    (r"engrave\.font", "--font"),
    (r"edges(\.radius_mm|\.shape)?", "--edges"),
    (r"start\.mesh(\.path)?", "--mesh"),
    (r"method\.exact\.table", "--table"),
    (r"purpose", "--for"),
    (r"(faces|candidates|pick)", r"--\1"),
)
"""Recipe keys at the start of error messages, as regular expressions, and the options that set
them."""

MIN_SIZE_MM = 1.0
"""Smallest size of a die without a recipe; a smaller one is probably meant in meters."""


GREEN, YELLOW, RED = 32, 33, 31
"""Colors of terminals (ECMA-48) for dice that converged, that have a warning, and that failed."""


def run_recipe(options: RunArguments) -> int:
    """Make a die from a recipe."""
    return _run(read_recipe(options.recipe, options.set), options, inputs=[options.recipe])


def design(options: DesignArguments) -> int:
    """Make a die from probabilities."""
    for name in ("repair", "item"):
        if getattr(options, name) and options.mesh is None:
            raise InputError(f"--{name}: expected --mesh FILE with it, got none; add it")
    with _name_options():
        text = options.target if options.text is None else options.text
        assert text is not None
        entries: dict[str, Any] = {
            "name": options.name,
            "seed": options.seed,
            "target": parse_target(text, options.labels),
        }
        if options.mesh is not None:
            mesh = {"path": options.mesh, "repair": options.repair, "item": options.item}
            entries |= {"start": {"mesh": mesh}, "method": {"concave": {}}}
        engrave = _engraving(options)
        if engrave or options.labels is not None:
            entries["engrave"] = engrave
        if options.edges is not None:
            entries["edges"] = _edges(options.edges)
        if options.size_mm is not None:
            entries["size_mm"] = options.size_mm
        if options.table is not None:
            entries["method"] = {"exact": {"table": options.table}}
        faces = options.faces
        given = {
            "faces": int(faces) if faces is not None and faces.isdecimal() else faces,
            "purpose": options.for_,
            "candidates": options.candidates,
            "pick": options.pick,
        }
        entries |= {key: value for key, value in given.items() if value is not None}
        if options.mesh is not None and options.table is not None:
            raise InputError(
                "--table: expected no --mesh with it, as such dice are for setting down, got both; "
                "leave one of them out"
            )
        resolve_paths(entries, Path())
        recipe = parse_recipe(entries)
        if recipe.size_mm < MIN_SIZE_MM:
            guess = 1000.0 * recipe.size_mm
            raise InputError(
                f"size_mm: expected at least {MIN_SIZE_MM:g} mm, got {recipe.size_mm:g}; "
                + (f"did you mean {guess:g}?" if guess >= MIN_SIZE_MM else "write such as 30")
            )
        return _run(recipe, options, enlarge=options.size_mm is None)


def _edges(text: str) -> dict[str, str]:
    """Entries of `edges` for the value of `--edges`."""
    return {"shape" if text.isalpha() else "radius_mm": text}


def _engraving(options: DesignArguments) -> dict[str, Any]:
    """Entries of `engrave` that options set."""
    entries: dict[str, Any] = {"content": "pips"} if options.pips else {}
    if options.font is not None:
        entries["font"] = options.font
    if options.icons is not None:
        entries["icons"] = {}
        for text in split_texts("engrave.icons", options.icons):
            label, equals, path = text.partition("=")
            if not (label and equals and path):
                raise InputError(
                    f"--icons: expected label=FILE.svg, got {text!r}; write such as "
                    "6=skull.svg,1=heart.svg"
                )
            entries["icons"][label.strip()] = path.strip()
    return entries


@contextmanager
def _name_options() -> Iterator[None]:
    """Replace recipe keys in error messages by the options that set them."""
    try:
        yield
    except InputError as error:
        message = str(error)
        for key, option in OPTION_OF_KEY:
            message = re.sub(rf"^{key}(?=: )", option, message)
        error.args = (message,)
        raise


def _run(
    recipe: Recipe, options: WithResults, *, enlarge: bool = False, inputs: Sequence[Path] = ()
) -> int:
    """Run a recipe with the options applied, and print the result. Returns the exit code: 0
    converged, 1 not converged. enlarge, inputs: as in `run`.

    Raises InputError for an unknown format or printer, and as `run`.
    """
    recipe = _apply_options(recipe, options)
    # An unreadable recipe does not need these imports.
    from dicedesign.recipe.pipeline import Callbacks, run
    from dicedesign.runtime.workers import progress_bar, show_part

    note_missing_kernels()
    with progress_bar("run") as bar:
        on_part, describe = partial(show_part, bar), bar.set_description_str

        def on_step(step: Step) -> None:
            parts = [f"step {step.step}"]
            if step.attempt is not None:
                parts = [f"attempt {step.attempt}, {step.stage}"]
            if step.max_abs_error is not None:
                parts.append(f"max |p - q| {step.max_abs_error:.2e}")
            bar.set_postfix_str(", ".join(parts))

        def on_round(throws: RoundOfThrows) -> None:
            describe(
                f"{throws.drops} throws, total variation {throws.deviation:.3f} "
                f"(perfect {throws.noise_floor:.3f})"
            )

        callbacks = Callbacks(
            partial(on_part, 0, None), on_step, on_round, describe, on_part=on_part
        )
        result = run(
            recipe,
            options.out,
            enlarge=enlarge,
            resume=options.resume,
            callbacks=callbacks,
            inputs=inputs,
        )
    print_notes(*result.notes)
    _print_result(result)
    return 0 if result.converged else 1


def _apply_options(recipe: Recipe, options: WithResults) -> Recipe:
    from dicedesign.fabricate.file_formats import with_stl
    from dicedesign.fabricate.printers import PrintOptions

    changes: dict[str, Any] = {}
    if options.files is not None:
        names = [name.strip() for name in options.files.split(",")]
        changes["files"] = with_stl(names, "--files")
    if options.printer is not None:
        with named("--printer"):
            printing = recipe.print or PrintOptions()
            if printing.printer != options.printer:
                # The recipe's limits hold for its own printer only.
                printing = PrintOptions(
                    options.printer,
                    infill=printing.infill,
                    walls_mm=printing.walls_mm,
                    errors=printing.errors,
                )
            changes["print"] = dataclasses.replace(printing, oriented=True)
    if options.no_figures:
        changes |= {"figures": False, "report": False}
    if options.no_clock:
        changes["clock"] = False
    return recipe.model_copy(update=changes)


def _print_result(result: Result) -> None:
    """Print the verdict, a table of target and probabilities in each file, and the files.

    For a thrown die the table also has the probabilities by model and by throws, for a concave die
    a row for all rests without an outcome.
    """
    print(f"{result.name}: {_colored(result)}")
    if len(result.candidates) > 1:
        print(_candidate_table(result.candidates))
    probabilities: dict[str, Sequence[float]] = {
        "target": result.target,
        "die_plain.stl": result.probabilities,
    }
    engraved = result.engraved
    if engraved is not None and engraved.probabilities is not None:
        probabilities["die.stl"] = engraved.probabilities
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
        elsewhere = {"target": 0.0, "die_plain.stl": result.elsewhere}
        if engraved is not None and engraved.elsewhere is not None:
            elsewhere["die.stl"] = engraved.elsewhere
        probabilities = {name: (*probabilities[name], other) for name, other in elsewhere.items()}
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
            f"least angle between outcomes: {result.least_angle_deg:.3g} degrees; least tilt that "
            f"leaves an outcome: {result.least_margin_deg:.3g} degrees"
        )
    balance = None if engraved is None or result.thrown is not None else engraved.balance
    if balance is not None and len(balance.errors) > 1:
        print(
            f"Labels and edges alone would have changed a probability by "
            f"{100.0 * balance.errors[0]:.2g} %. The "
            f"{'faces were moved' if balance.stretch is None else 'die was stretched'} to correct "
            "this."
        )
    if result.tolerances is not None:
        print(result.tolerances.answer)
    print(f"files in {printable(result.folder)}: {', '.join(result.files.values())}")


def _colored(result: Result) -> str:
    """Message of a result; on a terminal its first line is green, yellow with a warning, or red."""
    if not sys.stdout.isatty() or "NO_COLOR" in os.environ:
        return result.message
    color = YELLOW if result.is_warned else GREEN if result.converged else RED
    first, _, rest = result.message.partition("\n")
    return f"\x1b[{color}m{first}\x1b[0m\n{rest}"


def _candidate_table(candidates: Sequence[Candidate]) -> str:
    """Table of what distinguishes dice with different numbers of faces."""
    numbers = range(1, len(candidates) + 1)
    return text_table(
        ("pick", ">", numbers),
        ("die", "", [one.name for one in candidates]),
        ("thrown off %", ".1f", [100.0 * one.thrown for one in candidates]),
        ("9 of 10 hands %", ".1f", [100.0 * one.nine_in_ten for one in candidates]),
        ("prints %", ".1f", [100.0 * one.prints for one in candidates]),
        ("looks", ".2f", [one.looks for one in candidates]),
        ("read on top", "", ["yes" if one.is_read_on_top else "no" for one in candidates]),
        ("label mm", ".1f", [one.label_mm for one in candidates]),
        ("size mm", "g", [one.size_mm for one in candidates]),
        ("g", ">", _texts([one.weight_g for one in candidates], ".1f")),
        ("lacks", "", [", ".join(one.lacks) for one in candidates]),
    )


NOTED_GROWTH = 1.01
"""Ratio of the size of a die to that of its set above which a note says so."""


def make_dice_set(options: SetArguments) -> int:
    """Make a set of dice in one style."""
    from dicedesign.fabricate.finish_options import is_font_file
    from dicedesign.runtime.workers import progress_bar
    from dicedesign.sweep.dice_set import PLATE, make_set, set_recipes
    from dicedesign.sweep.ranking import PAGE

    style: dict[str, Any] = {"print": options.printer}
    if options.font is not None:
        is_file = is_font_file(options.font)
        style["engrave"] = {"font": os.path.realpath(options.font) if is_file else options.font}
    if options.edges is not None:
        style["edges"] = _edges(options.edges)
    recipes = set_recipes(options.dice, style)
    note_missing_kernels()
    with progress_bar("steps", 2 * len(recipes)) as bar:
        dice = make_set(recipes, options.size, options.out, bar.update)
    for die in dice:
        if die["size_mm"] > NOTED_GROWTH * options.size:
            print_notes(f"{die['name']}: {die['size_mm']:.1f} mm large, so that its labels fit")
        if die["status"] != "converged":
            print_notes(f"{die['name']}: {die['message']}")
    print(
        text_table(
            ("die", "", [die["name"] for die in dice]),
            ("size mm", ".2f", [die["size_mm"] for die in dice]),
            ("digits mm", ">", _texts([min(die["label_mm"] or [None]) for die in dice], ".2f")),
            ("max |p - q|", ".1e", [die["max_abs_error"] for die in dice]),
            ("status", "", [die["status"] for die in dice]),
        )
    )
    print(f"files in {printable(options.out)}: {PAGE}, {PLATE} and a folder for each die")
    return 0 if all(die["status"] == "converged" for die in dice) else 1


def sweep(options: SweepArguments) -> int:
    """Make a die for each combination of values of a recipe's keys, and rank them."""
    from dicedesign.results.folder import open_results_folder
    from dicedesign.sweep.dice import check_starts, combine, made_die, make_dice
    from dicedesign.sweep.ranking import LIST, PAGE, TABLE, write_sweep

    if options.seeds is not None:
        check_whole("--seeds", options.seeds)
    combinations = combine(options.recipe, options.set, options.seeds)
    title = read_recipe(options.recipe).name
    folder = options.out or Path("outputs") / f"{title}_sweep"
    missing = {
        name: die
        for name, die in combinations.items()
        if made_die(folder / name, die.recipe) is None
    }
    check_starts(missing)
    total, done = len(combinations), len(combinations) - len(missing)
    faults: dict[str, str] = {}
    inputs = [options.recipe]
    with open_results_folder(folder, [PAGE, TABLE, LIST], inputs):
        if missing:
            with workers_of(options, "dice", total, done) as workers:
                advance = workers.bar.update
                try:
                    faults = make_dice(
                        folder, missing, workers.executor, workers.jobs, advance, inputs
                    )
                except KeyboardInterrupt as interrupt:
                    message = "repeat the command to make the other dice"
                    raise KeyboardInterrupt(message) from interrupt
        rows = write_sweep(folder, title, combinations, faults)
    if done:
        print_notes(f"{done} dice were already in {folder}")
    print_notes(*(f"{name}: {fault}" for name, fault in faults.items()))
    converged = sum(row["status"] == "converged" for row in rows)
    print(f"{title}: {converged} of {total} dice converged")
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    print(
        text_table(
            ("rank", ">", _texts(columns["rank"], "d")),
            ("radius mm", ">", _texts(columns["inradius_mm"], ".3f")),
            ("margin deg", ">", _texts(columns["margin_deg"], ".3f")),
            ("max |p - q|", ">", _texts(columns["max_abs_error"], ".1e")),
            ("asymmetry", ">", _texts(columns["asymmetry"], ".4f")),
            ("status", "", columns["status"]),
            ("folder", "", columns["folder"]),
        )
    )
    if converged:
        print(f"best die: {printable(folder / rows[0]['folder'])}")
    print(f"files in {printable(folder)}: {PAGE}, {TABLE} and the folders above")
    return 0 if converged == total else 1


def _texts(values: Iterable[float | None], form: str) -> list[str]:
    """Texts of numbers; "" for None."""
    return ["" if value is None else format(value, form) for value in values]


def view(options: ViewArguments) -> int:
    """Serve the page of `dicedesign view`."""
    from dicedesign.view.application import make_page
    from dicedesign.view.server import serve

    serve(partial(make_page, options.path), options.port, browser=not options.no_browser)
    return 0
