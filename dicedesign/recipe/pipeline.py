"""The way from a recipe to a folder of results: the stages of a run, in order."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from dicedesign.errors import InputError
from dicedesign.recipe.reading import checked_recipe, read_recipe, recipe_text
from dicedesign.recipe.recipe import AUTO, Recipe
from dicedesign.recipe.work import Listeners, Work
from dicedesign.results.folder import RECIPE, folder_of_results, write_results
from dicedesign.results.result import Result
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.runtime.workers import one_tensor_thread


@dataclass(frozen=True, kw_only=True)
class Stage(Extension):
    """One stage of a run.

    Attributes
    ----------
    run: does its work, or the address "module:function" of what does, imported when it is wanted.
    wanted: whether a run needs it, asked when its turn comes.
    after: name of the stage that it follows; None for the built-in ones, whose order is that of
        their list, and for one that comes last.
    """

    run: Callable[[Work], Any] | str
    wanted: Callable[[Work], bool] = lambda work: True
    after: str | None = None


METHODS: Final = {
    "exact": "dicedesign.recipe.convex:design_exactly",
    "thrown": "dicedesign.recipe.thrown:design_for_table",
    "paper": "dicedesign.recipe.convex:design_as_paper",
    "concave": "dicedesign.recipe.concave:design_concave",
}
"""Addresses of the functions that make a `Design` of a `Work`."""


def load_method(work: Work) -> Callable[[Work], Any]:
    """The function of the recipe's method; its module brings torch along."""
    method = work.recipe.method
    return _function(METHODS["thrown" if method.thrown else method.name])


def run_method(work: Work) -> None:
    """Design the die of a recipe. Raises as its method."""
    with one_tensor_thread():
        work.die = load_method(work)(work)


STAGES: Final[Registry[Stage]] = Registry(
    "stage",
    Stage,
    (
        Stage(
            name="start",
            line="makes or reads the starting shape, and checks that it suits the target",
            run="dicedesign.recipe.start:make_start",
        ),
        Stage(
            name="load",
            line="loads the solver of the recipe's method, and torch with it, if that is not there "
            "yet",
            run=load_method,
        ),
        Stage(
            name="symmetry",
            line="finds the symmetry of a die whose recipe leaves it open",
            run="dicedesign.recipe.convex:choose_symmetry",
            wanted=lambda work: work.recipe.symmetry == AUTO,
        ),
        Stage(
            name="design",
            line="runs the recipe's method: exact, paper, concave, or exact for thrown dice",
            run=run_method,
        ),
        Stage(
            name="numbering",
            line="lets equally probable outcomes change places, so that the numbers suit the shape",
            run="dicedesign.recipe.solid:number",
            wanted=lambda work: work.recipe.numbering != "given",
        ),
        Stage(
            name="size",
            line="enlarges a die whose labels do not fit, where no size was given",
            run="dicedesign.recipe.solid:enlarge",
            wanted=lambda work: (
                work.enlarge and work.recipe.engrave is not None and work.die.reshaped is None
            ),
        ),
        Stage(
            name="export",
            line="brings the die to its size and makes die_plain.stl",
            run="dicedesign.recipe.solid:export",
        ),
        Stage(
            name="check",
            line="reads die_plain.stl back: its rests, their outcomes, and the verdict",
            run="dicedesign.recipe.solid:check",
        ),
        Stage(
            name="engrave",
            line="rounds the edges, cuts the labels in, leads the die to its target with both, "
            "makes die.stl and reads it back",
            run="dicedesign.recipe.engrave:engrave",
            wanted=lambda work: work.recipe.engrave is not None or work.recipe.edges is not None,
        ),
        Stage(
            name="inside",
            line="puts the center of mass where it was given, by a cavity or infill, and reads "
            "die.stl back",
            run="dicedesign.recipe.engrave:fill_inside",
            wanted=lambda work: work.recipe.inside is not None,
        ),
        Stage(
            name="throws",
            line="throws the printed die onto its table, with fresh random numbers",
            run="dicedesign.recipe.thrown:throw",
            wanted=lambda work: work.recipe.method.thrown,
        ),
        Stage(
            name="printing",
            line="says what the printer will not make and how the die lies best on its bed; makes "
            "die_oriented.stl",
            run="dicedesign.recipe.printing:prepare_print",
            wanted=lambda work: work.recipe.print is not None,
        ),
        Stage(
            name="tolerances",
            line="finds what errors of printing, and infill, do to the odds",
            run="dicedesign.recipe.printing:find_tolerances",
            # Of a file that meets itself slicers decide what is inside.
            wanted=lambda work: (
                work.printability is not None and work.printability.file.self_intersections == 0
            ),
        ),
        Stage(
            name="files",
            line="writes the die in the other formats that are asked for, and reads each back",
            run="dicedesign.recipe.files:write_files",
            wanted=lambda work: len(work.recipe.files) > 1 and work.folder is not None,
        ),
        Stage(
            name="figures",
            line="draws the pictures of the report, each a file of its own",
            run="dicedesign.recipe.report:draw_figures",
            wanted=lambda work: work.recipe.figures and work.folder is not None,
        ),
        Stage(
            name="data sheet",
            line="makes data_sheet.pdf and data_sheet.png, one page to print",
            run="dicedesign.recipe.report:write_data_sheet",
            wanted=lambda work: work.recipe.data_sheet and work.folder is not None,
        ),
        Stage(
            name="report",
            line="makes report.html, which needs no other file",
            run="dicedesign.recipe.report:write_page",
            wanted=lambda work: work.recipe.report and work.folder is not None,
        ),
    ),
    "dicedesign.stages",
)


def run_stages(work: Work, *, after: str | None = None, last: str | None = None) -> None:
    """Run the stages that a recipe needs.

    after: the stage that ran last, None to begin; last: the one that ends it, None for all. Raises
    what stages raise: `DiceError`s, and KeyboardInterrupt.
    """
    stages = _in_order()
    names = [stage.name for stage in stages]
    first = 0 if after is None else names.index(after) + 1
    end = len(names) if last is None else names.index(last) + 1
    for stage in stages[first:end]:
        if stage.wanted(work):
            with work.clock.stage(stage.name):
                run = _function(stage.run) if isinstance(stage.run, str) else stage.run
                run(work)


def _in_order() -> list[Stage]:
    """All stages; of several that follow the same one the first registered comes first."""
    order: list[Stage] = []
    for stage in STAGES:
        place = len(order)
        if stage.after is not None:
            place = order.index(STAGES[stage.after]) + 1
            while place < len(order) and order[place].after == stage.after:
                place += 1
        order.insert(place, stage)
    return order


def _function(address: str) -> Callable[[Work], Any]:
    module, _, name = address.partition(":")
    function: Callable[[Work], Any] = getattr(import_module(module), name)
    return function


def run(
    recipe: Recipe | Mapping[str, Any] | Path | str,
    out: Path | str | None = None,
    *,
    changes: Sequence[str] = (),
    enlarge: bool = False,
    resume: bool = False,
    listeners: Listeners | None = None,
) -> Result:
    """Design, check, engrave and report one die, and write what came of it.

    Files are written once the die is finished, each whole or not at all, and result.json last: a
    folder that has it is complete. A concave die alone keeps a checkpoint after each attempt. A die
    that did not converge and cannot be labelled is reported without die.stl.

    Parameters
    ----------
    recipe: a checked one, plain data as in a recipe file, or the path of one.
    out: folder of the results, made if missing; None for outputs/NAME.
    changes: texts "dotted.key=value" that change a file's entries.
    enlarge: where the labels do not fit at the recipe's size, take the smallest whole number of
        millimetres at which they do; the recipe that is written says so.
    resume: go on from the checkpoint of a concave die in the folder.
    listeners: progress callbacks.

    Raises
    ------
    InputError: the recipe cannot be used, the start does not suit the target, there is nothing to
        resume, or the design converged and a label does not fit.
    OutputError: the folder cannot be written. InputError too: another run is writing into it.
    KeyboardInterrupt: with a message about the checkpoint, if there is one, or that the results
        were complete.
    """
    if isinstance(recipe, str | Path):
        recipe = read_recipe(Path(recipe), changes)
    elif isinstance(recipe, Mapping):
        recipe = checked_recipe(recipe)
    if resume and recipe.method.concave is None:
        raise InputError(
            f"--resume: expected a recipe of method: {{concave: {{}}}}, got {recipe.method.name}, "
            "which keeps no checkpoint; leave it out"
        )
    folder = Path("outputs") / recipe.name if out is None else Path(out)
    work = Work(recipe, folder, listeners or Listeners(), enlarge, resume)
    with folder_of_results(folder):
        try:
            run_stages(work)
            return finish(work)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(str(interrupt) or work.kept) from interrupt


def finish(work: Work) -> Result:
    """Write the files of a run whose stages are done. Raises OutputError."""
    from dicedesign.fabricate.file_formats import FILE_FORMATS
    from dicedesign.report.figures import FIGURES

    assert work.folder is not None
    work.files[RECIPE] = recipe_text(work.recipe).encode("utf-8")
    checksums = {name: hashlib.sha256(data).hexdigest() for name, data in work.files.items()}
    result = dataclasses.replace(work.result(), sha256=checksums)
    names = [f"{figure.name}{figure.suffix}" for figure in FIGURES]
    names += [f"{stem}.{kind}" for stem in ("die", "die_plain") for kind in FILE_FORMATS.names]
    write_results(work.folder, work.files, result, names)
    return result
