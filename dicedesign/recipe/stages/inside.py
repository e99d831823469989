"""Stage inside: what puts the center of mass of the printed die where it was given."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dicedesign.errors import InputError
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.results.parts import Status
from dicedesign.tolerances import FILE_ODDS

if TYPE_CHECKING:
    from dicedesign.balance.ways import Made

__all__ = ["fill_inside"]


def fill_inside(work: Work) -> None:
    """Make die.stl once more, of the solid with its labels and edges, with its center of mass where
    it was given; read it back and judge it.

    Raises InputError if the die converged and nothing inside of it can do that; one that did not
    only says so.
    """
    from dicedesign.balance.ways import move_center, read_back
    from dicedesign.geometry.surfaces.surface import Surface

    options = work.recipe.inside
    assert options is not None
    body = read_back(work.files["die_plain.stl" if work.engraved is None else "die.stl"])
    assert body.triangles is not None
    try:
        # The center that was given is at the origin.
        surface = Surface(body.points, body.triangles)
        made = move_center(surface, np.zeros(3), options.by, options)
    except InputError as error:
        if work.status is Status.CONVERGED:
            raise InputError(f"inside: {error}") from error
        work.remarks.append(f"nothing inside: {error}")
        return
    _finish(work, made)


STAGES.register(
    Stage(
        name="inside",
        line="puts the center of mass where it was given, by a cavity or infill, and reads "
        "die.stl back",
        rank=62,
        wanted=lambda work: work.recipe.inside is not None,
        run=fill_inside,
    )
)


def _finish(work: Work, made: Made) -> None:
    from dataclasses import replace

    from dicedesign.fabricate.die import assess_file
    from dicedesign.geometry.sphere import norms
    from dicedesign.results.result import Inside

    assert work.recipe.inside is not None
    assert made.body.triangles is not None
    for rest, data in made.files.items():
        work.files[f"die{rest}" if rest else "die.stl"] = data
    by = work.recipe.inside.by
    # A cavity is judged by the file alone.
    center = None if by == "cavity" else made.center
    verdict = assess_file(made.files[""], work.die.directions, work.target, center, work.die.prior)
    points, triangles = made.body.points, made.body.triangles
    if work.engraved is None:
        work.engraved = work.solid
    work.engraved = replace(work.engraved, points=points, triangles=triangles, assessment=verdict)
    work.inside = Inside(
        by=by,
        shift_mm=float(norms(_outside_center(made))),
        off_mm=float(norms(made.center)),
        wall_mm=made.wall_mm,
        made=dict(made.facts),
        notes=made.notes,
    )
    work.notes += made.notes
    work.remarks.append(f"{verdict.max_abs_error:.3g} with its center of mass by {by}")
    most = max(work.recipe.method.tolerance, FILE_ODDS)
    is_off = verdict.max_abs_error > most and not work.recipe.method.thrown
    if is_off and work.status is Status.CONVERGED:
        work.status = Status.OFF_TARGET
        work.remarks.insert(0, work.status.value)


def _outside_center(made: Made) -> np.ndarray:
    """(3,) center of mass of the uniform solid within the outside."""
    from dicedesign.geometry.meshes.orientation import shells_of
    from dicedesign.geometry.solid import solid_properties

    assert made.body.triangles is not None
    shell = shells_of(made.body.triangles)
    solids = [
        solid_properties(made.body.points, made.body.triangles[shell == number])
        for number in range(int(shell.max()) + 1)
    ]
    return max(solids, key=lambda found: found[0])[1]
