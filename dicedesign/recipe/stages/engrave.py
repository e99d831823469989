"""Stage engrave: labels cut into the die, and the verdict on the file with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import EngravingError
from dicedesign.fabricate.designed_die import SizedDie
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.results.status import Status

if TYPE_CHECKING:
    from dicedesign.fabricate.labels.layout import Placement

__all__ = ["engrave", "place_on_facets"]

CHANGED: Final = 0.05
"""Relative change of an outcome's odds by engraving that is told."""


def engrave(work: Work) -> None:
    """Make die.stl: each label on the facet that the die rests on, or in the side that is up then
    where the die keeps the shape of a surface; and read it back.

    Raises EngravingError if the die converged and a label has no place on it; one that did not
    converge only says so.
    """
    try:
        _cut(work)
    except EngravingError as error:
        if work.status is Status.CONVERGED:
            raise
        work.remarks.append(f"not engraved: {error}")


STAGES.register(
    Stage(
        name="engrave",
        line="cuts the labels in, makes die.stl and reads it back",
        rank=60,
        wanted=lambda work: work.recipe.engrave is not None,
        run=engrave,
    )
)


def place_on_facets(
    solid: SizedDie, labels: Sequence[str], options: EngravingOptions
) -> list[Placement]:
    """Where labels lie on the facets that a die rests on.

    Raises EngravingError where a label has no facet or does not fit on it.
    """
    from dicedesign.fabricate.labels.edge_margins import edge_margins
    from dicedesign.fabricate.labels.layout import place_labels

    hull, main = solid.poses.hull, solid.outcomes.main
    _require_rests(labels, main, "a facet")
    facets = solid.poses.facets[main].tolist()
    return place_labels(
        labels,
        [hull.polygon(facet) for facet in facets],
        [hull.normals[facet] for facet in facets],
        facets,
        options,
        hull.diameter,
        [edge_margins(hull, facet, options) for facet in facets],
    )


def _cut(work: Work) -> None:
    from dicedesign.fabricate.finished_die import EngravedFile
    from dicedesign.fabricate.solids.engraving import engrave
    from dicedesign.fabricate.verdict import judged
    from dicedesign.geometry.meshes.stl import stl_bytes

    options, solid, labels = work.recipe.engrave, work.solid, work.target.labels
    assert options is not None
    placements: list[Placement] = []
    if work.die.reshaped is None:
        placements = place_on_facets(solid, labels, options)
        marked = engrave(solid.points, solid.triangles, placements, options)
    else:
        from dicedesign.fabricate.solids.marks import engrave_marks

        main = work.plain.outcomes.main
        _require_rests(labels, main, "a side")
        downs = work.plain.poses.normals[main]
        marked, _ = engrave_marks(solid.points, solid.triangles, downs, labels, options)
    data = stl_bytes(marked.points, marked.triangles)
    work.files["die.stl"] = data
    verdict = None
    if solid.center_of_mass is None:
        verdict = judged(data, work.die.directions, work.target)
        work.details |= verdict.odds("engraved_")
        if not work.recipe.method.thrown:
            work.remarks.append(f"{verdict.max_abs_error:.3g} with the labels cut in")
        work.notes += _changes(work, verdict.outcomes.odds)
    work.engraved = EngravedFile(marked.points, marked.triangles, verdict, tuple(placements))


def _require_rests(labels: Sequence[str], main: np.ndarray, what: str) -> None:
    if (main < 0).any():
        raise EngravingError(
            f"label {labels[int(main.argmin())]!r}: expected {what} to rest on for each label, got "
            "none for this one; finish the design first"
        )


def _changes(work: Work, engraved: np.ndarray) -> list[str]:
    """What the marks change by more than `CHANGED`, in at most one sentence."""
    plain = work.plain.outcomes.odds
    changes = np.abs(engraved - plain) / np.where(plain > 0.0, plain, np.inf)
    most = int(changes.argmax())
    if changes[most] <= CHANGED:
        return []
    return [
        f"engraving changes the odds of {work.target.labels[most]} by {changes[most]:.0%}; take a "
        "smaller depth_mm or a larger size_mm"
    ]
