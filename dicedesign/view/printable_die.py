"""The die of a session in millimeters, with its labels, and the files of it."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from dicedesign.errors import InputError
from dicedesign.fabricate.die import Assessment, Design
from dicedesign.fabricate.file_formats import FILE_FORMATS, Contents, file_bytes, mesh_bytes
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.sphere import angle_between
from dicedesign.optimize.starts.shapes import mesh_start
from dicedesign.recipe.output import die_contents
from dicedesign.recipe.pipeline import Callbacks, Work, run_stages
from dicedesign.recipe.reading import parse_recipe, recipe_text
from dicedesign.recipe.recipe import Recipe
from dicedesign.results.parts import Status
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import SAME_REST_ANGLE
from dicedesign.view.design_session import SHAPE_FILE, DesignedShape, DesignSession

__all__ = ["PrintableDie", "printable_die"]

_LONG_AGO: Final = (1980, 1, 1, 0, 0, 0)
"""Date of what is in an archive, so that the same die is the same file."""


@dataclass(frozen=True, eq=False)
class PrintableDie:
    """A die as it is printed.

    Attributes
    ----------
    recipe: that makes it again.
    shape: as it was designed.
    is_kept: whether its recipe begins with that shape, as nothing else leads there.
    status: whether it has the probabilities that were asked for, or what is wrong.
    message: what there is to say of it, as in result.json; notes: what was assumed, sentences.
    directions: (k, 3) down in the outcomes, of the solid.
    verdict: on the file that is printed, as it was read back; plain: the same without labels.
    stl: that file; contents: the same for other formats.
    points: (n, 3) in mm, and triangles: (t, 3) of it.
    """

    recipe: Recipe
    shape: DesignedShape
    is_kept: bool
    status: Status
    message: str
    notes: tuple[str, ...]
    directions: Floats
    verdict: Assessment
    plain: Assessment
    stl: bytes
    contents: Contents
    points: Floats
    triangles: Integers

    @classmethod
    def of(cls, work: Work, shape: DesignedShape, *, is_kept: bool) -> PrintableDie:
        """The die of stages that have run. It holds nothing of what they had to draw labels."""
        engraved = work.engraved
        solid = work.solid if engraved is None else engraved
        return cls(
            recipe=work.recipe,
            shape=shape,
            is_kept=is_kept,
            status=work.status,
            message="; ".join(work.remarks),
            notes=tuple(work.notes),
            directions=work.die.directions,
            verdict=(engraved and engraved.assessment) or work.plain,
            plain=work.plain,
            stl=work.files["die_plain.stl" if engraved is None else "die.stl"],
            contents=die_contents(work),
            points=solid.points,
            triangles=solid.triangles,
        )

    @property
    def is_converged(self) -> bool:
        """Whether it has the probabilities that were asked for."""
        return self.status is Status.CONVERGED

    def rows(self) -> Iterator[tuple[str, float, float]]:
        """Label, target and probabilities in the file of each outcome."""
        target = self.recipe.target.target()
        probabilities = self.verdict.outcomes.probabilities
        yield from zip(
            target.labels, target.probabilities.tolist(), probabilities.tolist(), strict=True
        )

    def file(self, ending: str) -> tuple[str, bytes]:
        """Name and content in one of `FILE_FORMATS`. Raises InputError where it cannot be made."""
        name = f"{self.recipe.name}.{ending}"
        if ending == "stl":
            return name, self.stl
        return name, file_bytes(self.contents, FILE_FORMATS[ending], name)

    def recipe_file(self) -> tuple[str, bytes]:
        """Name and content of a file from which `dicedesign run` makes a die of these
        probabilities: the recipe, or an archive of it and the shape that it begins with."""
        name, text = self.recipe.name, recipe_text(self.recipe).encode()
        if not self.is_kept:
            return f"{name}.yaml", text
        hull, archive = self.shape.hull, io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
            for member, data in (
                ("recipe.yaml", text),
                (SHAPE_FILE, mesh_bytes(hull.vertices, hull.triangles, ".off")),
            ):
                file.writestr(zipfile.ZipInfo(member, _LONG_AGO), data)
        return f"{name}.zip", archive.getvalue()


def printable_die(
    session: DesignSession,
    *,
    size_mm: float | None = None,
    engrave: bool = True,
    on_stage: Callable[[str], None] = lambda name: None,
) -> PrintableDie:
    """The present shape of a session, through the stages of a run that come after the design.

    Parameters
    ----------
    size_mm: largest distance of two corners; None for 30, or as much as the labels need.
    engrave: whether the labels are cut in.
    on_stage: called with the name of each stage as it begins.

    Raises InputError where there is no shape yet, the size cannot be, a label does not fit or is
    on no facet, or the shape has other rests that are more probable than those of the outcomes.
    """
    shape, designed, is_straight = session.end()
    if shape is None:
        raise InputError("die: expected a shape to print, got none yet; design one")
    entries = session.request.recipe().resolved() | {"engrave": engrave}
    if size_mm is not None:
        entries["size_mm"] = size_mm
    is_kept = designed is None or not is_straight
    if is_kept:
        entries |= _kept(shape, session.recipe)
    recipe = parse_recipe(entries)
    work = Work(recipe, callbacks=Callbacks(on_stage), enlarge=size_mm is None)
    work.die = designed or _as_it_is(shape, recipe)
    run_stages(work, after="design", last="throws")
    return PrintableDie.of(work, shape, is_kept=is_kept)


def _as_it_is(shape: DesignedShape, recipe: Recipe) -> Design:
    is_reached = shape.error <= recipe.method.tolerance
    return Design(
        status=Status.CONVERGED if is_reached else Status.OFF_TARGET,
        hull=shape.hull,
        directions=shape.directions,
        error=shape.error,
        steps=(),
        terms=shape.terms,
    )


def _kept(shape: DesignedShape, recipe: Recipe) -> dict[str, Any]:
    """Entries of a recipe that begins with a shape and leaves it as it is. Raises InputError where
    the rests that outcomes lie on are not the most probable."""
    labels, hull = recipe.target.target().labels, shape.hull
    start = mesh_start(make_body(hull.vertices, hull.triangles), len(labels))
    angles = angle_between(start.directions[:, None], shape.directions[None])
    nearest = angles.argmin(axis=1)
    is_one = np.array_equal(np.sort(nearest), np.arange(len(labels)))
    if not is_one or angles.min(axis=1).max() > SAME_REST_ANGLE:
        raise InputError(
            "die: expected a shape whose most probable rests bear the outcomes, got one that rests "
            "elsewhere more often; design on"
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
    }
