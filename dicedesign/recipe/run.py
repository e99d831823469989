"""From a recipe to a folder of results: plan the stages it needs, run only those."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.design.refinement import Round
from dicedesign.design.result import DesignStep
from dicedesign.design.starts.start import Start
from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.fabricate.options import EngravingOptions
from dicedesign.fabricate.verdict import Verdict
from dicedesign.geometry.meshes.stl import stl_bytes
from dicedesign.recipe.design_stage import DesignedDie, design_die, make_start, resized, thrown_die
from dicedesign.recipe.schema.reading import recipe_text
from dicedesign.recipe.schema.recipe import MOST_MM, Recipe
from dicedesign.recipe.summary import (
    design_summary,
    engraved_notes,
    odds_summary,
    size_note,
    target_summary,
)
from dicedesign.recipe.table_summary import table_outcome, table_summary
from dicedesign.results.folder import RunResult, add_report, write_results
from dicedesign.results.status import Status
from dicedesign.runtime.clock import Clock
from dicedesign.runtime.files import make_writable_folder

if TYPE_CHECKING:
    from dicedesign.fabricate.engraving import EngravedDie
    from dicedesign.fabricate.layout import Placement

__all__ = ["engrave_die", "run_recipe"]


def run_recipe(
    recipe: Recipe,
    folder: Path,
    *,
    enlarge: bool = False,
    on_stage: Callable[[str], None] | None = None,
    on_step: Callable[[DesignStep], None] | None = None,
    on_round: Callable[[Round], None] | None = None,
) -> RunResult:
    """Design, check, engrave and report one convex die.

    Nothing is written before the die is finished. Each file then appears whole or not at all, and
    result.json last: a folder that has it is complete. A die that did not converge and cannot be
    labelled is reported without die.stl.

    Parameters
    ----------
    recipe: the checked recipe.
    folder: where to write; made if missing, once the start is known to be usable.
    enlarge: where the labels do not fit at the recipe's size, take the smallest whole number of
        millimetres at which they do; the recipe that is written says so.
    on_stage, on_step, on_round: called when a stage begins, after every accepted step, and after
        every round of throws.

    Raises
    ------
    InputError: the start does not suit the target, the method is concave, or the design converged
        and a label does not fit its facet.
    OutputError: the folder cannot be written.
    """
    clock = Clock(on_stage=on_stage)
    with clock.stage("start"):
        start = make_start(recipe)
        if recipe.engrave is not None:
            from dicedesign.fabricate.glyphs import require_glyphs

            require_glyphs(recipe.target.target().labels)
    make_writable_folder(folder)
    with clock.stage("design"):
        die = design_die(recipe, start, on_step=on_step, on_round=on_round)
    notes = () if start is None else start.notes
    if enlarge:
        with clock.stage("size"):
            fitting = _fitting(recipe, die)
            if fitting != recipe:
                recipe, die = fitting, resized(die, fitting, start)
                notes += (size_note(recipe.size_mm),)
    files, summary = _results(recipe, die, start, clock)
    write_results(folder, files, summary)
    notes += tuple(engraved_notes(summary))
    return RunResult(summary["status"], summary["message"], notes, folder, summary)


def _plain_name(status: Status) -> str:
    return status.name.lower()


def _fitting(recipe: Recipe, die: DesignedDie) -> Recipe:
    """The recipe, with the size at which the labels fit where that is a larger one."""
    if recipe.engrave is None:
        return recipe
    try:
        _place(die, recipe.engrave, recipe.size_mm)
    except LabelRoomError as error:
        if error.size_mm <= MOST_MM:
            return recipe.model_copy(update={"size_mm": float(math.ceil(error.size_mm))})
    except EngravingError:
        # No size helps; engraving says why.
        pass
    return recipe


def _results(
    recipe: Recipe, die: DesignedDie, start: Start | None, clock: Clock
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """The content of every file but result.json, by name, and that of result.json."""
    hull, status, message = die.verdict.hull, die.status, die.message
    files: dict[str, bytes] = {}
    with clock.stage("export"):
        files["die_plain.stl"] = stl_bytes(hull.vertices, hull.triangles)
    engraved: EngravedDie | None = None
    placements: list[Placement] = []
    if recipe.engrave is not None:
        with clock.stage("engrave"):
            try:
                engraved, placements = engrave_die(die, recipe.engrave, recipe.size_mm)
                files["die.stl"] = stl_bytes(engraved.vertices, engraved.triangles)
            except EngravingError as error:
                if die.status is Status.CONVERGED:
                    raise
                message += f"; not engraved: {error}"
    on_table = None
    if recipe.method.thrown:
        with clock.stage("throws"):
            on_table = thrown_die(recipe, die, start, engraved)
            status, message = table_outcome(status, message, on_table, die.target, recipe)
    with clock.stage("summary"):
        summary = {
            "name": recipe.name,
            "status": _plain_name(status),
            "message": message,
            **target_summary(die.target),
            **odds_summary(die.verdict, die.target, engraved),
            **design_summary(die.design),
        }
        if on_table is not None:
            summary["thrown"] = table_summary(on_table, die.target)
    with clock.stage("figures"):
        tolerance = recipe.method.tolerance
        images = _figures(summary, tolerance, die.verdict, engraved, placements)
        if on_table is not None:
            from dicedesign.recipe.table_figures import table_figures

            images |= table_figures(summary, on_table)
    add_report(files, summary, images, recipe_text(recipe), clock, _page)
    return files, summary


def _page(summary: Mapping[str, Any], images: Mapping[str, bytes]) -> str:
    from dicedesign.report.pages.die_page import report_html

    return report_html(summary, images)


def engrave_die(
    die: DesignedDie, options: EngravingOptions, size_mm: float
) -> tuple[EngravedDie, list[Placement]]:
    """Cut the labels into a designed die of a largest vertex-to-vertex distance `size_mm`.

    Returns the engraved solid and where each label is. Raises EngravingError where a label has no
    facet or does not fit on it.
    """
    from dicedesign.fabricate.engraving import engrave

    hull, placements = die.verdict.hull, _place(die, options, size_mm)
    return engrave(hull.vertices, hull.triangles, placements, options), placements


def _place(die: DesignedDie, options: EngravingOptions, size_mm: float) -> list[Placement]:
    from dicedesign.fabricate.layout import place_labels

    hull, labels = die.verdict.hull, die.target.labels
    facets = die.verdict.facet_of_outcome.tolist()
    if -1 in facets:
        raise EngravingError(
            f"label {labels[facets.index(-1)]!r}: expected a facet to rest on for each label, got "
            "none for this one; finish the design first"
        )
    return place_labels(
        labels,
        [hull.polygon(facet) for facet in facets],
        [hull.normals[facet] for facet in facets],
        facets,
        options,
        size_mm,
    )


def _figures(
    summary: dict[str, Any],
    tolerance: float,
    verdict: Verdict,
    engraved: EngravedDie | None,
    placements: list[Placement],
) -> dict[str, bytes]:
    from dicedesign.report.charts.png import png_bytes
    from dicedesign.report.figures.bars import bars_figure
    from dicedesign.report.figures.convergence import convergence_figure
    from dicedesign.report.figures.die_views import die_views_figure, facet_views_figure
    from dicedesign.report.figures.gauss_map import gauss_map_figure

    labels = summary["labels"]
    written = [facet["label"] or "" for facet in summary["facets"]]
    solid = verdict.hull if engraved is None else engraved
    images = {
        "bars": bars_figure(labels, np.array(summary["target"]), verdict.probabilities),
        "convergence": convergence_figure(summary["history"], tolerance),
        "gauss_map": gauss_map_figure(verdict.poses, written),
        "views": die_views_figure(solid.vertices, solid.triangles),
    }
    if engraved is not None:
        images["labels"] = facet_views_figure(
            engraved.vertices,
            engraved.triangles,
            np.array([placement.frame[:3, 2] for placement in placements]),
            np.array([placement.frame[:3, 1] for placement in placements]),
            [placement.text for placement in placements],
        )
    return {name: png_bytes(figure) for name, figure in images.items()}
