"""Stage engrave: the finished die with its edges and labels, led to the target, and the verdict on
its file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.errors import EngravingError
from dicedesign.fabricate.designed_die import SizedDie
from dicedesign.fabricate.labels.options import EngravingOptions
from dicedesign.fabricate.solids.edge_options import EdgeOptions, core_scale
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.results.status import Status
from dicedesign.tolerances import FILE_ODDS

if TYPE_CHECKING:
    from collections.abc import Callable

    from dicedesign.fabricate.balance.convex_object import Measured
    from dicedesign.fabricate.labels.layout import Placement
    from dicedesign.fabricate.labels.reading import Reading
    from dicedesign.fabricate.verdict import Verdict
    from dicedesign.geometry.hulls.hull import ConvexHull
    from dicedesign.geometry.surfaces.surface import Surface
    from dicedesign.gradient.thrown_odds import ThrownOdds
    from dicedesign.runtime.arrays import Floats

__all__ = ["engrave", "place_on_facets"]

LEFT: Final = 1e-9
"""Largest |p - q| that moving facets may leave."""

LEFT_THROWN: Final = 1e-3
"""The same of odds by a momentum model, which is itself ten times as far from simulated throws; it
has kinks, at which facets may be stuck."""

MET_BY_STRETCH: Final = 6
"""Outcomes whose odds a stretch can meet exactly."""

CHANGED: Final = 0.05
"""Relative change of an outcome's odds by labels and edges that is told."""


def engrave(work: Work) -> None:
    """Make die.stl: edges rounded; each label where the die is read, or in the side that is up then
    where the die keeps the shape of a surface; and the shape moved until the odds are the target's.
    Read it back.

    Raises EngravingError if the die converged and a label has no place on it; one that did not
    converge only says so.
    """
    try:
        if work.die.reshaped is None:
            _make_convex(work)
        else:
            _mark_surface(work)
    except EngravingError as error:
        if work.status is Status.CONVERGED:
            raise
        work.remarks.append(f"not engraved: {error}")


STAGES.register(
    Stage(
        name="engrave",
        line="rounds the edges, cuts the labels in, leads the die to its target with both, makes "
        "die.stl and reads it back",
        rank=60,
        wanted=lambda work: work.recipe.engrave is not None or work.recipe.edges is not None,
        run=engrave,
    )
)


def core_of(solid: SizedDie, edges: EdgeOptions | None) -> ConvexHull:
    """The shape inside the rounded edges of a convex die, its facets numbered as those of the die.

    Raises EngravingError where the radius is larger than the circle of a facet to rest on.
    """
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.hulls.polygons import facet_inradius

    hull = solid.poses.hull
    if edges is None:
        return hull
    core = convex_hull(core_scale(edges, hull.diameter) * hull.vertices)
    for facet in solid.poses.facets.tolist():
        room = facet_inradius(core, facet)
        if edges.radius_mm > room:
            raise EngravingError(
                f"edges.radius_mm: expected at most the radius of the circle that is left flat on "
                f"facet {facet}, {room:.3g} mm, got {edges.radius_mm:g}; lower it, or take a "
                "larger size_mm"
            )
    return core


def place_on_facets(
    solid: SizedDie,
    labels: Sequence[str],
    options: EngravingOptions,
    edges: EdgeOptions | None = None,
) -> tuple[Reading, list[Placement]]:
    """How a die is read, and where its labels lie on its facets, within its rounded edges, in the
    order of the places of that reading.

    Raises EngravingError where an outcome has no facet to rest on, the die cannot be read as the
    options say, or a label does not fit.
    """
    from dicedesign.fabricate.labels.edge_margins import edge_margins
    from dicedesign.fabricate.labels.layout import place_labels
    from dicedesign.fabricate.labels.reading import die_readings
    from dicedesign.fabricate.solids.engraving import require_fields

    hull, main = core_of(solid, edges), solid.outcomes.main
    _require_rests(labels, main, "a facet")
    *better, last = die_readings(hull, solid.poses.facets[main], labels, options.read)

    def placed(reading: Reading) -> list[Placement]:
        places, whole = reading.places, reading.way != "corner"
        return place_labels(
            [place.text for place in places],
            [place.region for place in places],
            [place.normal for place in places],
            [place.facet for place in places],
            # Around a corner labels stand upright toward it.
            options if whole else replace(options, upright="edge"),
            solid.poses.hull.diameter,
            [edge_margins(hull, place.facet, options) for place in places] if whole else None,
        )

    for reading in better:
        with suppress(EngravingError):
            placements = placed(reading)
            require_fields(hull, placements, options)
            return reading, placements
    return last, placed(last)


def _make_convex(work: Work) -> None:
    """The finished object of a convex die."""
    from dicedesign.fabricate.balance.convex_object import ConvexObject
    from dicedesign.fabricate.balance.reshaping import MOST_ROUNDS, largest_move, reshaped
    from dicedesign.results.balance import Balance

    options, edges, solid = work.recipe.engrave, work.recipe.edges, work.solid
    placements: list[Placement] = []
    if options is not None:
        work.reading, placements = place_on_facets(solid, work.target.labels, options, edges)
    made, core = ConvexObject(options, edges), core_of(solid, edges)
    if solid.center_of_mass is not None:
        _finish(work, made.engraved(core, placements), made.placed(placements))
        return
    by = "shape" if options is None else options.balance
    rounds = MOST_ROUNDS if by != "none" and work.status is Status.CONVERGED else 0
    measure, thrown, target = _measure(work)
    directions = work.die.directions
    end = reshaped(
        core, directions, placements, target, made, measure, rounds=rounds, thrown=thrown
    )
    work.details["balance"] = Balance(
        by, tuple(end.first.odds.tolist()), end.errors, largest_move(core, end.core)
    )
    surface, placed = made.engraved(end.core, end.placements), made.placed(end.placements)
    left, few = min(end.errors), len(target) <= MET_BY_STRETCH
    is_left = left > FILE_ODDS or (few and left > LEFT)
    if rounds and is_left and not work.recipe.method.thrown and by != "fill":
        # Symmetric shapes whose corners fall apart when single facets move, and those with several
        # facets an outcome.
        _finish_stretched(work, surface, placed, by)
        return
    inlay = made.inlay(end.core, end.placements) if by == "fill" else None
    _finish(work, surface, placed, end.measured.center_of_mass, inlay)


def _measure(
    work: Work,
) -> tuple[Callable[[Surface, Floats], Measured], ThrownOdds | None, Floats]:
    """How an object is measured, the model by which it is reshaped, and its target (k,): for a die
    to be thrown the odds that the plain shape has by the momentum model."""
    from dicedesign.fabricate.balance.convex_object import measure_resting, measure_thrown
    from dicedesign.geometry.surfaces.surface import Surface

    if not work.recipe.method.thrown:
        return measure_resting, None, work.target.probabilities
    from dicedesign.gradient.thrown_odds import ThrownOdds
    from dicedesign.recipe.methods.exact import exact_options
    from dicedesign.throws.momentum.momentum_model import momentum_model
    from dicedesign.throws.tables import table_named

    name = exact_options(work.recipe).table
    measure = measure_thrown(table_named(name), momentum_model(name))
    plain = Surface(work.solid.points, work.solid.triangles)
    return measure, ThrownOdds.on(name), measure(plain, work.die.directions).odds


def _mark_surface(work: Work) -> None:
    """The finished object of a die that keeps the shape of a surface."""
    from dicedesign.fabricate.labels.reading import MARKED
    from dicedesign.fabricate.solids.marks import engrave_marks

    options, solid, labels = work.recipe.engrave, work.solid, work.target.labels
    assert options is not None
    main = work.plain.outcomes.main
    _require_rests(labels, main, "a side")
    downs = work.plain.poses.normals[main]
    work.reading = MARKED
    marked, _ = engrave_marks(solid.points, solid.triangles, downs, labels, options)
    if options.balance == "none" or work.status is not Status.CONVERGED:
        _finish(work, marked, ())
        return
    _finish_stretched(work, marked, (), options.balance)


def _finish_stretched(
    work: Work, surface: Surface, placements: Sequence[Placement], by: str
) -> None:
    """The object of a surface, stretched until it has the odds."""
    from dicedesign.fabricate.balance.stretching import stretched
    from dicedesign.results.balance import Balance

    center = surface.centroid
    surface = surface.moved(surface.points - center)
    end = stretched(surface, work.die.directions, work.target.probabilities)
    before = work.details.get("balance")
    scales = np.linalg.eigvalsh(end.matrix)
    moved = float(np.linalg.norm(end.surface.points - surface.points, axis=1).max())
    if before is None:
        before = Balance(by, tuple(end.unbalanced.tolist()), (), 0.0)
    work.details["balance"] = Balance(
        by,
        before.unbalanced,
        (*(before.errors or end.errors[:1]), end.errors[-1]),
        before.moved_mm + moved,
        float(scales[-1] / scales[0] - 1.0),
    )
    placements = [placement.moved(-center).stretched(end.matrix) for placement in placements]
    _finish(work, end.surface, placements)


def _finish(
    work: Work,
    surface: Surface,
    placements: Sequence[Placement],
    center: Floats | None = None,
    inlay: Surface | None = None,
) -> None:
    """Make die.stl and judge it.

    center: (3,) point to put at the origin, or None to leave the surface where it is; inlay: bodies
    that fill the labels, which have a file of their own.
    """
    from dicedesign.fabricate.finished_die import EngravedFile
    from dicedesign.fabricate.verdict import judged
    from dicedesign.geometry.meshes.stl import stl_bytes
    from dicedesign.geometry.surfaces.surface import joined

    if center is not None:
        surface = surface.moved(surface.points - center)
        placements = [placement.moved(-center) for placement in placements]
        inlay = None if inlay is None else inlay.moved(inlay.points - center)
    work.files["die.stl"] = stl_bytes(surface.points, surface.triangles)
    whole = surface
    if inlay is not None:
        work.files["die_inlay.stl"] = stl_bytes(inlay.points, inlay.triangles)
        whole = joined(surface, inlay)
    verdict = None
    if work.solid.center_of_mass is None:
        data = stl_bytes(whole.points, whole.triangles)
        verdict = judged(data, work.die.directions, work.target)
        work.details |= verdict.odds("engraved_")
        work.notes += _changes(work, verdict.outcomes.odds)
        _tell(work, verdict)
    work.engraved = EngravedFile(
        surface.points, surface.triangles, verdict, tuple(placements), inlay
    )


def _tell(work: Work, verdict: Verdict) -> None:
    """The odds of the finished die, in words; it has not converged where they are off the target
    though its shape was to be moved to that."""
    recipe, balance = work.recipe, work.details.get("balance")
    with_what = (
        "labels and edges"
        if recipe.engrave and recipe.edges
        else ("the labels cut in" if recipe.engrave else "its edges rounded")
    )
    if not recipe.method.thrown:
        work.remarks.append(f"{verdict.max_abs_error:.3g} with {with_what}")
    if balance is None or balance.by == "none" or work.status is not Status.CONVERGED:
        return
    if recipe.method.thrown:
        is_off = min(balance.errors) > LEFT_THROWN
    else:
        is_off = verdict.max_abs_error > max(recipe.method.tolerance, FILE_ODDS)
    if is_off:
        work.status = Status.UNBALANCED
        work.remarks.insert(0, work.status.value)
    elif recipe.symmetry is not None and balance.moved_mm > 0.0:
        work.notes.append(
            f"with {with_what} the die has no symmetry {recipe.symmetry}, as its facets were moved "
            f"by up to {balance.moved_mm:.2g} mm to keep the odds"
        )


def _require_rests(labels: Sequence[str], main: np.ndarray, what: str) -> None:
    if (main < 0).any():
        raise EngravingError(
            f"label {labels[int(main.argmin())]!r}: expected {what} to rest on for each label, got "
            "none for this one; finish the design first"
        )


def _changes(work: Work, engraved: np.ndarray) -> Iterator[str]:
    """What labels and edges change by more than `CHANGED`, in at most one sentence."""
    plain = work.plain.outcomes.odds
    changes = np.abs(engraved - plain) / np.where(plain > 0.0, plain, np.inf)
    most = int(changes.argmax())
    if changes[most] > CHANGED:
        yield (
            f"the finished die differs from the plain one in the odds of "
            f"{work.target.labels[most]} by {changes[most]:.0%}; take a smaller depth_mm or a "
            "larger size_mm"
        )
