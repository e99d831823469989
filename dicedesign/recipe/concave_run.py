"""From a recipe for a concave die to a folder of results, with a checkpoint to go on from."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.concave.checkpoint import checkpoint_bytes, read_checkpoint
from dicedesign.concave.result import ConcaveDie, ConcaveProgress, ConcaveStep
from dicedesign.concave.search import make_concave_die
from dicedesign.errors import DiceError, EngravingError, InputError
from dicedesign.fabricate.options import EngravingOptions
from dicedesign.fabricate.printable import printable_solid
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.recipe.concave_judging import (
    JudgedSurface,
    concave_options,
    judge_file,
    make_input_surface,
    outcomes_of_file,
    search_identity,
)
from dicedesign.recipe.concave_summary import engraved_summary, search_summary, surface_summary
from dicedesign.recipe.schema.reading import recipe_text
from dicedesign.recipe.schema.recipe import Recipe
from dicedesign.recipe.summary import engraved_notes, target_summary
from dicedesign.results.folder import CHECKPOINT, RunResult, add_report, write_results
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.clock import Clock
from dicedesign.runtime.files import atomic_write, make_writable_folder

__all__ = ["in_millimetres", "run_concave_recipe"]


def run_concave_recipe(
    recipe: Recipe,
    folder: Path,
    *,
    resume: bool = False,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callable[[ConcaveStep], None] | None = None,
) -> RunResult:
    """Design, fill, check and report one concave die, perhaps with marks cut in.

    After each attempt the state of the search is kept in the folder as `CHECKPOINT`. All else is
    written once the die is finished, each file whole or not at all, and result.json last; then the
    checkpoint is removed. Whether the die converged is told by its STL file as it is read back.

    Parameters
    ----------
    recipe: the checked recipe, its method concave.
    folder: where to write; made if missing, once the surface is known to be usable.
    resume: go on from the checkpoint in the folder.
    on_stage, on_step: called when a stage begins and after every accepted step.

    Raises
    ------
    InputError: the surface cannot be used or does not suit the target, no attempt led to a die,
        there is no checkpoint of the same search to resume, or the die converged and a mark has no
        place on it.
    OutputError: the folder cannot be written.
    KeyboardInterrupt: with a message about the checkpoint, if there is one of this run.
    """
    clock, target = Clock(on_stage=on_stage), recipe.target.target()
    with clock.stage("start"):
        surface, notes = make_input_surface(recipe)
        if recipe.engrave is not None:
            from dicedesign.fabricate.glyphs import require_glyphs

            require_glyphs(target.labels)
        search, path = search_identity(recipe, surface), folder / CHECKPOINT
        progress = read_checkpoint(path, search) if resume else None
    with _folder(folder), _explained_interrupt(progress) as keep:

        def on_attempt(progress: ConcaveProgress) -> None:
            atomic_write(path, checkpoint_bytes(progress, search))
            keep(progress)

        with clock.stage("design"):
            die = make_concave_die(
                surface,
                target.probabilities,
                concave_options(recipe),
                seed=recipe.seed,
                resume=progress,
                on_step=on_step,
                on_attempt=on_attempt,
            )
        files, summary = _results(recipe, die, notes, clock)
        write_results(folder, files, summary)
    told = (*summary["notes"], *engraved_notes(summary))
    return RunResult(summary["status"], summary["message"], told, folder, summary)


@contextmanager
def _folder(folder: Path) -> Iterator[None]:
    """Make a folder, and take it away again where an error left nothing in it."""
    existed = folder.exists()
    make_writable_folder(folder)
    try:
        yield
    except DiceError:
        if not existed:
            # It is not empty where attempts were made.
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


@contextmanager
def _explained_interrupt(
    progress: ConcaveProgress | None,
) -> Iterator[Callable[[ConcaveProgress], None]]:
    """Let an interrupt say what is kept. Yields what is to be told of each checkpoint."""
    latest = progress

    def keep(progress: ConcaveProgress) -> None:
        nonlocal latest
        latest = progress

    try:
        yield keep
    except KeyboardInterrupt as interrupt:
        if latest is None:
            raise
        raise KeyboardInterrupt(_kept(latest)) from interrupt


def _kept(progress: ConcaveProgress) -> str:
    done = f"{progress.attempts} attempt{'' if progress.attempts == 1 else 's'} done"
    if progress.best is None:
        best = "none led to a die yet"
    else:
        best = (
            f"the best is off by {progress.best.error:.2e}, its mean displacement "
            f"{100.0 * progress.best.displacement:.2g} % of the diagonal"
        )
    return f"{done}, {best}; run it again with --resume to go on"


def _results(
    recipe: Recipe, die: ConcaveDie, notes: tuple[str, ...], clock: Clock
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """The content of every file but result.json, by name, and that of result.json."""
    files: dict[str, bytes] = {}
    with clock.stage("export"):
        placed, hull_points = in_millimetres(die, recipe.size_mm)
        printable = True
        try:
            points, triangles, changes = printable_solid(placed)
        except InputError as error:
            # Then it did not converge, and is written as it is.
            printable = False
            points, triangles, changes = placed.points, placed.triangles, (str(error),)
        files["die_plain.stl"] = stl_bytes(points, triangles)
    with clock.stage("check"):
        judged = judge_file(recipe, die, files["die_plain.stl"], hull_points, printable)
    target, message = recipe.target.target(), judged.message
    engraved: dict[str, Any] = {}
    if recipe.engrave is not None:
        with clock.stage("engrave"):
            try:
                files["die.stl"] = _engraved(points, triangles, judged, target.labels, recipe)
                outcomes = outcomes_of_file(files["die.stl"], die.directions)[-1]
                engraved = engraved_summary(outcomes, target)
                message += f"; {engraved['engraved_max_abs_error']:.3g} with the marks cut in"
            except InputError as error:
                if not judged.failures:
                    raise
                message += f"; not engraved: {error}"
    with clock.stage("summary"):
        summary = {
            "name": recipe.name,
            "status": judged.status.name.lower(),
            "message": message,
            **target_summary(target),
            **surface_summary(judged, die, target),
            **engraved,
            **search_summary(die),
            "notes": [*notes, *changes],
        }
    with clock.stage("figures"):
        from dicedesign.recipe.concave_figures import concave_figures

        images = concave_figures(recipe, judged, die)
    add_report(files, summary, images, recipe_text(recipe), clock, _page)
    return files, summary


def _page(summary: Mapping[str, Any], images: Mapping[str, bytes]) -> str:
    from dicedesign.report.pages.concave_page import concave_report_html

    return concave_report_html(summary, images)


def in_millimetres(die: ConcaveDie, size_mm: float) -> tuple[Surface, Floats]:
    """The die with its center of mass at the origin and the largest distance of two of its points
    `size_mm`, and the corners (v, 3) of the designed hull there."""
    center = die.after.centroid
    scale = size_mm / convex_hull(die.after.points).diameter
    placed = die.after.moved((die.after.points - center) * scale)
    return placed, (die.hull.vertices - center) * scale


def _engraved(
    points: Floats,
    triangles: Integers,
    judged: JudgedSurface,
    labels: tuple[str, ...],
    recipe: Recipe,
) -> bytes:
    """The STL file of the die with a mark for each outcome."""
    from dicedesign.fabricate.marks import engrave_marks

    outcomes, options = judged.outcomes, recipe.engrave
    assert isinstance(options, EngravingOptions)
    if (outcomes.rest_counts == 0).any():
        raise EngravingError(
            f"label {labels[int(np.argmin(outcomes.rest_counts))]!r}: expected a side to rest on "
            "for each label, got none for this one; finish the design first"
        )
    downs = judged.poses.normals[outcomes.main]
    engraved, _ = engrave_marks(points, triangles, downs, labels, options)
    return stl_bytes(engraved.vertices, engraved.triangles)
