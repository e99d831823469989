"""From a recipe to a folder of results."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dicedesign.errors import InputError
from dicedesign.recipe.planning.stage import plan
from dicedesign.recipe.planning.work import Listeners, Work
from dicedesign.recipe.schema.reading import checked_recipe, read_recipe, recipe_text
from dicedesign.recipe.schema.recipe import Recipe

if TYPE_CHECKING:
    from dicedesign.results.result import Result

__all__ = ["finish", "run"]


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
    listeners: who is told of stages, steps and rounds.

    Raises
    ------
    InputError: the recipe cannot be used, the start does not suit the target, there is nothing to
        resume, or the design converged and a label does not fit.
    OutputError: the folder cannot be written. InputError too: another run is writing into it.
    KeyboardInterrupt: with a message about the checkpoint, if there is one, or that the results
        were complete.
    """
    from dicedesign.results.folder import folder_of_results

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
            plan(work)
            return finish(work)
        except KeyboardInterrupt as interrupt:
            raise KeyboardInterrupt(str(interrupt) or work.kept) from interrupt


def finish(work: Work) -> Result:
    """Write the files of a run whose stages are done. Raises OutputError."""
    from dicedesign.fabricate.file_formats import FILE_FORMATS
    from dicedesign.report.figures.figure import FIGURES
    from dicedesign.results.folder import RECIPE, write_results

    assert work.folder is not None
    work.files[RECIPE] = recipe_text(work.recipe).encode("utf-8")
    checksums = {name: hashlib.sha256(data).hexdigest() for name, data in work.files.items()}
    result = dataclasses.replace(work.result(), sha256=checksums)
    names = [f"{figure.name}{figure.suffix}" for figure in FIGURES]
    names += [f"{stem}.{kind}" for stem in ("die", "die_plain") for kind in FILE_FORMATS.names]
    write_results(work.folder, work.files, result, names)
    return result
