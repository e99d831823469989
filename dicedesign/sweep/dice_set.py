"""Set of dice in one style: sizes from face to face, labels of one height, all on one print bed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dicedesign.errors import EngravingError, InputError, RecipeError, named
from dicedesign.fabricate.die import make_solid
from dicedesign.fabricate.file_formats import Contents, Part, three_mf
from dicedesign.fabricate.numbering import opposite_facets
from dicedesign.fabricate.printability import least_details, narrowest_stroke
from dicedesign.geometry.triangles import Surface
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import Work, finish, run_stages
from dicedesign.recipe.reading import parse_recipe, parse_target
from dicedesign.recipe.recipe import Recipe
from dicedesign.recipe.recipe_files import input_files, output_names
from dicedesign.recipe.solid import place_at_size
from dicedesign.report.colored_die import color_parts
from dicedesign.report.pages import set_page
from dicedesign.rest.poses import RestPoses
from dicedesign.results.folder import open_results_folder
from dicedesign.runtime.arrays import Floats
from dicedesign.runtime.files import json_text
from dicedesign.runtime.outputs import checksums, replace_files
from dicedesign.sweep.dice import MAX_FOLDER_NAME
from dicedesign.sweep.ranking import PAGE, Row

PLATE, TABLE = "plate.3mf", "set.json"

GAP_MM = 5.0
"""Distance between dice on the print bed."""


def set_recipes(dice: Sequence[str], style: Mapping[str, Any]) -> dict[str, Recipe]:
    """Recipes of the dice of a set, by name.

    Parameters
    ----------
    dice: targets as on the command line, such as "d6", "d%", "2d6" or "4dF".
    style: entries of all recipes, such as `edges`.

    Raises RecipeError if a target or the style is invalid, or two dice are the same.
    """
    recipes: dict[str, Recipe] = {}
    for text in dice:
        name = (
            re.sub(r"[^\w.]+", "-", text.replace("%", "00")).strip("-._")[:MAX_FOLDER_NAME].lower()
        )
        if name in recipes:
            raise RecipeError(f"{text}: expected dice that differ, got it twice; leave one out")
        with named(text):
            recipes[name] = parse_recipe({"name": name, "target": parse_target(text), **style})
    return recipes


def make_set(
    recipes: Mapping[str, Recipe],
    size_mm: float,
    folder: Path,
    on_die: Callable[[], object] = lambda: None,
) -> list[Row]:
    """Make the dice of a set, each in its subfolder, and one plate, page and table of all. Returns
    the entries of the table.

    No file is written before all dice are finished.

    Parameters
    ----------
    recipes: by subfolder, of one printer; `set_recipes` makes them.
    size_mm: distance between opposite faces, or mean height at rest, by probability; dice whose
        labels do not fit become larger.
    folder: made if missing.
    on_die: called twice for each die, after it is designed and after it is finished.

    Raises
    ------
    InputError: a die cannot be made, or the dice do not fit on the print bed. OutputError: the
        folder cannot be written.
    """
    works = [Work(recipe, folder / name) for name, recipe in recipes.items()]
    with ExitStack() as stack:
        stack.enter_context(open_results_folder(folder, [PLATE, PAGE, TABLE]))
        for name, recipe in recipes.items():
            names, inputs = output_names(recipe, folder / name), input_files(recipe)
            stack.enter_context(open_results_folder(folder / name, names, inputs))
        heights = [(math.inf, 0.0)]
        for name, work in zip(recipes, works, strict=True):
            with named(name):
                heights.append(_design(work, size_mm))
            on_die()
        fitting, printable = zip(*heights, strict=True)
        for name, work in zip(recipes, works, strict=True):
            engrave = work.recipe.engrave
            if engrave is not None:
                # The largest height that fits on all faces of all dice, if the printer shows it.
                most = max(min(fitting), *printable, engrave.min_height_mm)
                engrave = replace(engrave, max_height_mm=min(most, engrave.max_height_mm))
                work.recipe = work.recipe.model_copy(update={"engrave": engrave})
            with named(name):
                run_stages(work, after="size")
            on_die()
        solids = [die_contents(work).parts for work in works]
        motions = _place_on_bed(works, [solid for solid, *_ in solids])
        parts = [
            replace(_move(solid, motion), name=work.recipe.name)
            for (solid, *_), motion, work in zip(solids, motions, works, strict=True)
        ]
        dice = [_describe(work) for work in works]
        colored = [
            (color_parts(parts, work.result()), work.result())
            for parts, work in zip(solids, works, strict=True)
        ]
        placed = [
            _move(part, motion)
            for (parts, _), motion in zip(colored, motions, strict=True)
            for part in parts
        ]
        files = {
            PLATE: three_mf(Contents(f"{len(dice)} dice", parts, is_plate=True)),
            PAGE: set_page(placed, dice, colored).encode("utf-8"),
        }
        sums = checksums(files)
        table = json_text({"size_mm": size_mm, "dice": dice, "sha256": sums}).encode("utf-8")
        with replace_files(folder, files, sums, TABLE, table):
            for work in works:
                finish(work)
    return dice


def _design(work: Work, size_mm: float) -> tuple[float, float]:
    """Design a die of a size, or larger if its labels need it. Returns the height that fits on all
    its faces, and the one at which the printer shows all its labels: infinity and 0 if a die that
    did not converge has no room for them."""
    # Not enlarged yet: of searched shapes, those with room for labels are preferred.
    run_stages(work, last="numbering")
    recipe, solid = work.recipe, make_solid(work.die, 1.0)
    # Rounded edges add their radius on both sides of a smaller body.
    rounding = 0.0 if recipe.edges is None else 2.0 * recipe.edges.radius_mm
    diameter = (size_mm - rounding) / _height_at_rest(solid, solid.poses) + rounding
    entries = recipe.as_dict() | {"size_mm": max(diameter, size_mm)}
    work.recipe, work.enlarge = parse_recipe(entries), True
    run_stages(work, after="numbering", last="size")
    engrave, printing = work.recipe.engrave, work.recipe.print
    assert engrave is not None
    assert printing is not None
    with suppress(EngravingError):
        placements = place_at_size(work, work.die, work.recipe.size_mm)
        finest = [
            one.height * least / width
            for one in {one.text: one for one in placements}.values()
            for least, side in least_details(printing.selected_printer, engrave)
            if (width := narrowest_stroke(one.section(), side)) is not None
        ]
        return min(one.height for one in placements), max(finest, default=0.0)
    return math.inf, 0.0


def _height_at_rest(solid: Surface, poses: RestPoses) -> float:
    """Mean height of a solid at rest, by probability."""
    return float(np.ptp(solid.points @ poses.normals.T, axis=0) @ poses.probabilities)


def _move(part: Part, motion: Floats) -> Part:
    """Part after a rigid motion (4, 4)."""
    return replace(part, points=part.points @ motion[:3, :3].T + motion[:3, 3])


def _place_on_bed(works: Sequence[Work], solids: Sequence[Part]) -> list[Floats]:
    """Rigid motions (4, 4) of finished dice, each in its best orientation, to rows in the middle of
    the print bed, from the back to the front. Raises InputError if they do not fit."""
    motions, parts = [], []
    for work, solid in zip(works, solids, strict=True):
        assert work.printability is not None
        motions.append(np.array(work.printability.placement))
        parts.append(_move(solid, motions[-1]))
    assert works[0].recipe.print is not None
    printer = works[0].recipe.print.selected_printer
    bed = np.array([printer.bed_width_mm, printer.bed_depth_mm])
    sides = np.array([np.ptp(part.points[:, :2], axis=0) for part in parts]) + GAP_MM
    rows: list[list[int]] = [[]]
    for die, width in enumerate(sides[:, 0]):
        if rows[-1] and sides[rows[-1], 0].sum() + width > bed[0]:
            rows.append([])
        rows[-1].append(die)
    middles, depths = np.zeros_like(sides), [sides[row, 1].max() for row in rows]
    for row, back, depth in zip(rows, np.cumsum(depths), depths, strict=True):
        ends = np.cumsum(sides[row, 0])
        middles[row, 0] = (bed[0] - ends[-1]) / 2.0 + ends - sides[row, 0] / 2.0
        middles[row, 1] = (bed[1] + sum(depths)) / 2.0 - back + depth / 2.0
    if (middles < sides / 2.0).any():
        raise InputError(
            f"--printer: expected dice that fit on the bed of {printer.name}, {bed[0]:g} by "
            f"{bed[1]:g} mm, got {len(rows)} rows of up to "
            f"{max(sides[row, 0].sum() for row in rows):.0f} mm, {sum(depths):.0f} mm deep in all, "
            "with gaps; make fewer or smaller dice at a time"
        )
    for motion, middle in zip(motions, middles, strict=True):
        motion[:2, 3] += middle
    return motions


def _describe(work: Work) -> Row:
    """Entry of a finished die in set.json.

    "size_mm": mean height at rest, by probability: between opposite faces if they are parallel.
    "label_mm": smallest and largest height of its digits. "reading": how to read it.
    """
    poses, heights = work.plain.poses, [each.height for each in work.finished.placements]
    return {
        "name": work.recipe.name,
        "status": work.status.name.lower(),
        "message": work.message.splitlines()[0],
        "size_mm": _height_at_rest(work.finished, work.final.poses),
        "has_parallel_faces": bool((opposite_facets(poses.hull, poses.facets) >= 0).all()),
        "label_mm": [min(heights), max(heights)] if heights else None,
        "max_abs_error": work.final.max_abs_error,
        "reading": None if work.reading is None else work.reading.sentence,
        "file": f"{work.stem}.stl",
    }
