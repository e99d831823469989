"""Printable die of a design session, in millimeters with labels, and its files."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.die import Design
from dicedesign.fabricate.file_formats import FILE_FORMATS, file_bytes, mesh_bytes
from dicedesign.geometry.meshes.body import body_of
from dicedesign.geometry.sphere import angle_between
from dicedesign.optimize.starts.shapes import mesh_start
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import parse_recipe, recipe_text
from dicedesign.recipe.recipe import AUTO, Recipe
from dicedesign.results.parts import Status
from dicedesign.tolerances import SAME_REST_ANGLE
from dicedesign.view.design_session import SHAPE_FILE, DesignedShape, DesignSession

__all__ = ["PrintableDie", "make_printable"]

_ARCHIVE_DATE: Final = (1980, 1, 1, 0, 0, 0)
"""Fixed date of the files in an archive, so that equal dice have equal files."""


@dataclass(frozen=True, eq=False)
class PrintableDie:
    """Die that is ready to print.

    Attributes
    ----------
    work: finished run of the stages: recipe, files, status and notes.
    shape: designed shape.
    needs_shape: the recipe starts from the shape, because no recipe alone leads to it.
    """

    work: Work
    shape: DesignedShape
    needs_shape: bool

    def rows(self) -> Iterator[tuple[str, float, float]]:
        """Yield the label, the target and the probability in the file of each outcome."""
        target = self.work.target
        probabilities = self.work.final.outcomes.probabilities
        yield from zip(
            target.labels, target.probabilities.tolist(), probabilities.tolist(), strict=True
        )

    def file(self, ending: str) -> tuple[str, bytes]:
        """Name and content in one of `FILE_FORMATS`. Raises InputError as the format does."""
        name = f"{self.work.recipe.name}.{ending}"
        if ending == "stl":
            return name, self.work.files[f"{self.work.stem}.stl"]
        return name, file_bytes(die_contents(self.work), FILE_FORMATS[ending], name)

    def recipe_file(self) -> tuple[str, bytes]:
        """Name and content of the recipe, or of an archive with the recipe and its shape."""
        name, text = self.work.recipe.name, recipe_text(self.work.recipe).encode()
        if not self.needs_shape:
            return f"{name}.yaml", text
        hull, archive = self.shape.hull, io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
            for member, data in (
                ("recipe.yaml", text),
                (SHAPE_FILE, mesh_bytes(hull.vertices, hull.triangles, ".obj")),
            ):
                file.writestr(zipfile.ZipInfo(member, _ARCHIVE_DATE), data)
        return f"{name}.zip", archive.getvalue()


def make_printable(
    session: DesignSession,
    *,
    size_mm: float | None = None,
    engrave: bool = True,
    on_stage: Callable[[str], None] = lambda name: None,
) -> PrintableDie:
    """Run the stages after the design on the current shape of a session.

    Parameters
    ----------
    size_mm: largest distance between two corners; None is 30, or more if the labels need it.
    engrave: engrave the labels.
    on_stage: called with the name of each stage at its start.

    Raises InputError: there is no shape yet, the size is not allowed, a label does not fit or has
    no facet, or other rests are more probable than those of the outcomes.
    """
    shape, design, follows_recipe = session.snapshot()
    if shape is None:
        raise InputError("die: expected a shape to print, got none yet; design one")
    entries = session.request.recipe().as_dict() | {"engrave": engrave}
    if size_mm is not None:
        entries["size_mm"] = size_mm
    needs_shape = design is None or not follows_recipe
    if needs_shape:
        entries |= _shape_entries(shape, session.recipe)
    recipe = parse_recipe(entries)
    work = Work(recipe, callbacks=Callbacks(on_stage), enlarge=size_mm is None)
    is_converged = shape.error <= recipe.method.tolerance
    work.die = design or Design(
        status=Status.CONVERGED if is_converged else Status.OFF_TARGET,
        hull=shape.hull,
        directions=shape.directions,
        error=shape.error,
        steps=(),
        terms=shape.terms,
        outcome_of=shape.target.outcome_of_face,
    )
    run_stages(work, after="design", last="throws")
    return PrintableDie(work, shape, needs_shape)


def _shape_entries(shape: DesignedShape, recipe: Recipe) -> dict[str, Any]:
    """Entries of a recipe that starts from a shape and does not change it.

    Raises InputError: the rests of the outcomes are not the most probable ones.
    """
    labels, hull = recipe.target.target().face_labels, shape.hull
    start = mesh_start(body_of(hull.surface), len(labels))
    angles = angle_between(start.directions[:, None], shape.directions[None])
    nearest = angles.argmin(axis=1)
    is_permutation = np.array_equal(np.sort(nearest), np.arange(len(labels)))
    if not is_permutation or angles.min(axis=1).max() > SAME_REST_ANGLE:
        raise InputError(
            "die: expected a shape whose most probable rests are those of the outcomes, got other "
            "rests that are more probable; continue the design"
        )
    if shape.error <= recipe.method.tolerance:
        method: dict[str, Any] = {"exact": {"prefer": {}}}
    else:
        paper = {"steps": 0, "perturbation": 0.0, "finish": "none"}
        method = {"paper": {**paper, "tolerance": recipe.method.tolerance}}
    return {
        "start": {"mesh": {"path": SHAPE_FILE}},
        "assignment": [labels[outcome] for outcome in nearest],
        "method": method,
        # Of many shapes, this is the one.
        "symmetry": "none" if recipe.symmetry in (None, AUTO) else recipe.symmetry,
    }
