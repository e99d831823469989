"""Stages engrave and inside: edges, labels, and cavities or infill, with the checked file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from dicedesign.errors import InputError, LabelRoomError
from dicedesign.fabricate.convex_object import (
    ConvexObject,
    core_of,
    measure_resting,
    measure_thrown,
)
from dicedesign.fabricate.die import MARKED_PROBABILITY, Assessment, assess_file
from dicedesign.fabricate.engraving import (
    even_depths,
    labels_off_surface,
    place_on_facets,
    require_rests,
)
from dicedesign.fabricate.label_layout import Placement
from dicedesign.fabricate.label_reading import Reading
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.reading import read_stl, stl_bytes
from dicedesign.geometry.sphere import norms
from dicedesign.geometry.triangles import Surface, join_surfaces
from dicedesign.gradient.probability_model import (
    ProbabilityModel,
    ThrowProbabilities,
    probability_model,
)
from dicedesign.optimize.solvers.reshaping import MOST_ROUNDS, largest_move, reshape, stretch
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.solid import check, export
from dicedesign.results.parts import Cavities, Concave, Status
from dicedesign.results.result import Balance, Inside
from dicedesign.runtime.arrays import Floats
from dicedesign.tolerances import FILE_PROBABILITIES, MOST_MM

MAX_ERROR = 1e-9
"""Largest |p - q| after moving facets."""

MAX_THROWN_ERROR = 1e-3
"""Largest |p - q| by a momentum model, whose kinks can stop the facets; its own error is ten times
larger."""

MIN_RELATIVE_MOVE = 1e-9
"""Distance over die size below which facets count as unmoved."""

MAX_STRETCHED_OUTCOMES = 6
"""Number of outcomes whose probabilities a stretch can meet exactly."""

NOTED_CHANGE = 0.05
"""Relative change of a probability by labels and edges that gets a note."""

RARE_SHARE = 1e-3
"""Share of its target below which a probability's change is relative to the target."""


def engrave(work: Work) -> None:
    """Make die.stl with rounded edges and labels, adjust the shape until it has the target
    probabilities, and read it back.

    Raises InputError if a label does not fit a die that converged; otherwise adds a remark. A
    surface without a given size only gets a note, as the search for it took long.
    """
    try:
        if work.die.reshaped is None:
            _finish_convex(work)
        else:
            _mark_surface(work)
    except InputError as error:
        if work.status is not Status.CONVERGED:
            work.remarks.append(f"not engraved: {error}")
        elif work.enlarge and work.die.reshaped is not None:
            work.notes.append(f"the die has no labels: {error}")
        else:
            if work.resume_note:
                error.args = (f"{error}; {work.resume_note}",)
            raise


def _finish_convex(work: Work) -> None:
    """Finish a convex die."""
    options, edges, solid = work.recipe.engrave, work.recipe.edges, work.solid
    given, is_thrown = solid.center_of_mass, work.recipe.method.is_thrown
    core = core_of(solid.poses, edges)
    placements: list[Placement] = []
    can_be_even = False
    if options is not None:
        labels = work.target.face_labels
        work.reading, placements = place_on_facets(solid, core, labels, options)
        is_plain = (options.style, options.balance) == ("engraved", "shape")
        # Moved facets would split corners of many edges, and change thrown probabilities.
        is_special = work.die.symmetry is not None or len(work.candidates) > 0
        can_be_even = is_plain and is_special and given is None
    before = placements
    if can_be_even and edges is None:
        placements = _even_pockets(work, placements)
    # Equal faces stay so; to move them would split corners, which the momentum model takes ill.
    stays = placements is not before and np.ptp(work.target.face_probabilities) == 0.0
    finish = ConvexObject(options, edges, None if given is None else given - core.centroid)
    if given is not None and (edges is None or is_thrown):
        # Labels do not change the hull.
        _finish(work, finish.make_engraved(core, placements), finish.place_labels(placements), core)
        return
    by = "shape" if options is None else options.balance
    is_moved = by != "none" and work.status is Status.CONVERGED and not stays
    rounds = MOST_ROUNDS if is_moved else 0
    directions, (target, outcome_of) = work.die.directions, work.target.wanted
    table, prior = work.recipe.method.table, work.die.prior
    if given is not None or table is None:
        offset = None if given is None else given - finish.make_unlabeled(core).centroid
        model: ProbabilityModel = probability_model(None, prior)
        measure = measure_resting(prior, offset, outcome_of)
    else:
        # Keep the probabilities that the plain shape has in the momentum model.
        measure = measure_thrown(table, outcome_of)
        model = ThrowProbabilities.on(table)
        target = measure(solid, directions).probabilities
    fit = partial(
        reshape,
        core,
        directions,
        target=target,
        labeled=finish,
        measure=measure,
        rounds=rounds,
        model=model,
        outcome_of=outcome_of,
    )
    end = fit(placements)
    if can_be_even and edges is not None and min(end.errors) > MAX_ERROR:
        # Corners of symmetric shapes split when single facets move.
        even = _even_pockets(work, list(finish.place_labels(placements)))
        shares = [label.depth_share for label in even]
        end = fit([replace(p, depth_share=s) for p, s in zip(placements, shares, strict=True)])
    work.balance = Balance(
        by,
        tuple(work.target.sums(end.first.probabilities).tolist()),
        end.errors,
        largest_move(core, end.core),
    )
    placed, center = finish.place_labels(end.placements), end.measured.center_of_mass
    is_left = min(end.errors) > MAX_ERROR and len(target) <= MAX_STRETCHED_OUTCOMES
    if by == "fill":
        marked = finish.make_engraved(end.core, end.placements)
        inlay = finish.inlay(end.core, end.placements)
        _finish(work, marked, placed, end.core, center, inlay)
    elif rounds and is_left and given is None and not is_thrown:
        # Symmetric shapes whose corners split when single facets move, and shapes with several
        # facets per outcome.
        _finish_stretched(work, end.surface, placed, by, end.core)
    else:
        _finish(work, end.surface, placed, end.core, center)


def _even_pockets(work: Work, placements: list[Placement]) -> list[Placement]:
    """Keep the symmetry of a die by the depths of its pockets, if they and the printer allow it.
    The printer is not asked if edges are rounded, as then nothing else keeps the probabilities."""
    engrave, printing = work.recipe.engrave, work.recipe.print
    assert engrave is not None
    depth = engrave.depth_mm
    even = even_depths(placements, depth, work.solid.poses.hull.centroid)
    if even is None:
        return placements
    least = depth * min(placement.depth_share for placement in even)
    shown = 0.0
    if printing is not None and work.recipe.edges is None:
        shown = min(depth, printing.selected_printer.groove_depth_mm)
    if least < shown:
        return placements
    symmetry = work.die.symmetry
    work.notes.append(
        f"labels are {least:.2g} to {depth:.2g} mm deep, so that the probabilities "
        f"{'' if symmetry is None else f'and the symmetry {symmetry} '}stay as they are"
    )
    return even


def _mark_surface(work: Work) -> None:
    """Engrave marks into a concave die, after enlarging it if they need it and no size is given."""
    from dicedesign.fabricate.marks import engrave_marks

    options, solid, of_faces = work.recipe.engrave, work.solid, work.target.face_labels
    assert options is not None
    main, shown = work.plain.outcomes.main, work.plain.shown_faces(MARKED_PROBABILITY)
    require_rests([of_faces[face] for face in shown], main[shown], "a side")
    cut = [face for face in shown if of_faces[face] not in options.blank]
    labels, downs = [of_faces[face] for face in cut], work.plain.poses.normals[main[cut]]
    work.reading = Reading("marks")
    try:
        marked, _ = engrave_marks(solid, downs, labels, options)
    except LabelRoomError as error:
        size_mm = float(math.ceil(error.size_mm))
        is_larger = work.recipe.size_mm < size_mm <= MOST_MM
        if not (work.enlarge and is_larger and work.status is Status.CONVERGED):
            raise
        work.recipe = work.recipe.model_copy(update={"size_mm": size_mm})
        work.remarks.clear()
        work.notes = [note for note in work.notes if note not in solid.changes]
        work.notes.append(f"size_mm: {size_mm:g}, so that the labels fit")
        export(work)
        check(work)
        _mark_surface(work)
        return
    if options.balance == "none" or work.status is not Status.CONVERGED:
        _finish(work, marked)
    else:
        _finish_stretched(work, marked, (), options.balance)
    marks = labels_off_surface(marked, solid, options.depth_mm)
    work.engraved = replace(work.finished, marks=marks)
    if work.concave is not None and work.concave.cavities is not None:
        _measure_marked_wall(work, work.concave, work.concave.cavities)


def _measure_marked_wall(work: Work, concave: Concave, cavities: Cavities) -> None:
    """Record the least wall between marks and cavities, and note one that the printer cannot
    make."""
    from dicedesign.balance.cavity import measure_cavities

    wall = measure_cavities(read_stl(work.files["die.stl"]).surface).wall_mm
    work.concave = replace(concave, cavities=replace(cavities, marked_wall_mm=wall))
    if work.recipe.print is None:
        return
    printer = work.recipe.print.selected_printer
    if wall < printer.wall_mm:
        work.notes.append(
            f"the walls between marks and cavity measure {wall:.2g} mm, {printer.name} makes "
            f"{printer.wall_mm:.2g} mm or more: raise method.concave.hollow.wall_mm, or reduce "
            "engrave.depth_mm"
        )


def _finish_stretched(
    work: Work,
    surface: Surface,
    placements: Sequence[Placement],
    by: str,
    core: ConvexHull | None = None,
) -> None:
    """Stretch a surface until it has the probabilities, and finish it."""
    center = surface.centroid
    surface = surface.with_points(surface.points - center)
    wanted, outcome_of = work.target.wanted
    end = stretch(surface, work.die.directions, wanted, work.die.prior, outcome_of)
    unbalanced = tuple(work.target.sums(end.unbalanced).tolist())
    before = work.balance or Balance(by, unbalanced, end.errors[:1], 0.0)
    scales = np.linalg.eigvalsh(end.matrix)
    work.balance = replace(
        before,
        errors=(*before.errors, end.errors[1]),
        moved_mm=before.moved_mm + float(norms(end.surface.points - surface.points).max()),
        stretch=float(scales[-1] / scales[0] - 1.0),
    )
    placements = [placement.shift(-center).stretch(end.matrix) for placement in placements]
    if core is not None:
        core = convex_hull((core.vertices - center) @ end.matrix.T)
    _finish(work, end.surface, placements, core)


def _finish(
    work: Work,
    surface: Surface,
    placements: Sequence[Placement] = (),
    core: ConvexHull | None = None,
    center: Floats | None = None,
    inlay: Surface | None = None,
) -> None:
    """Make die.stl and assess it.

    core: see `Solid`; center: (3,) point to move to the origin, or None to keep the place; inlay:
    bodies that fill the labels, written to their own file.
    """
    if center is not None:
        surface = surface.with_points(surface.points - center)
        placements = [placement.shift(-center) for placement in placements]
        inlay = None if inlay is None else inlay.with_points(inlay.points - center)
        core = None if core is None else convex_hull(core.vertices - center)
    data = work.files["die.stl"] = stl_bytes(surface)
    if inlay is not None:
        work.files["die_inlay.stl"] = stl_bytes(inlay)
        data = stl_bytes(join_surfaces(surface, inlay))
    verdict = None
    if work.solid.center_of_mass is None:
        die = work.die
        verdict = assess_file(data, die.directions, work.target, prior=die.prior, within=die.within)
        _describe(work, verdict)
    work.engraved = replace(
        work.solid,
        points=surface.points,
        triangles=surface.triangles,
        assessment=verdict,
        placements=tuple(placements),
        inlay=inlay,
        core=core,
    )


def _describe(work: Work, verdict: Assessment) -> None:
    """Add remarks and notes on the finished die, and fail it if its probabilities miss the target
    although its shape was adjusted."""
    recipe, balance, is_thrown = work.recipe, work.balance, work.recipe.method.is_thrown
    plain, target = work.plain.outcomes.probabilities, work.target.probabilities
    # A failed die may have nearly zero probability of an outcome.
    changes = np.abs(verdict.outcomes.probabilities - plain) / np.where(
        plain > RARE_SHARE * target, plain, target
    )
    most = int(changes.argmax())
    if changes[most] > NOTED_CHANGE:
        work.notes.append(
            f"the finished die differs from the plain one in the probabilities of "
            f"{work.target.labels[most]} by {changes[most]:.0%}; take a smaller depth_mm or a "
            "larger size_mm"
        )
    if not is_thrown:
        work.remarks.append(f"{verdict.max_abs_error:.3g} in die.stl")
    if balance is None or balance.by == "none" or work.status is not Status.CONVERGED:
        return
    is_off = verdict.max_abs_error > max(recipe.method.tolerance, FILE_PROBABILITIES)
    if min(balance.errors) > MAX_THROWN_ERROR if is_thrown else is_off:
        work.fail(Status.UNBALANCED)
    elif work.die.symmetry is not None and balance.moved_mm > MIN_RELATIVE_MOVE * recipe.size_mm:
        work.notes.append(
            f"die.stl has no symmetry {work.die.symmetry}, as its facets were moved by up to "
            f"{balance.moved_mm:.2g} mm to keep the probabilities"
        )


def fill_inside(work: Work) -> None:
    """Move the center of mass to the given place by a cavity or infill, rewrite die.stl, and assess
    it.

    Raises InputError if that is impossible for a die that converged; otherwise adds a remark.
    """
    from dicedesign.balance.ways import move_center

    options, method = work.recipe.inside, work.recipe.method
    assert options is not None
    surface = read_stl(work.files[f"{work.stem}.stl"]).surface
    try:
        # The given center is at the origin.
        filled = move_center(surface, np.zeros(3), options.by, options)
    except InputError as error:
        if work.status is Status.CONVERGED:
            raise InputError(f"inside: {error}") from error
        work.remarks.append(f"nothing inside: {error}")
        return
    work.files |= {f"die{rest}" if rest else "die.stl": data for rest, data in filled.files.items()}
    # The file alone determines a die with a cavity.
    center = None if options.by == "cavity" else filled.center
    verdict = assess_file(
        filled.files[""], work.die.directions, work.target, center, work.die.prior
    )
    work.engraved = replace(
        work.finished,
        points=filled.body.points,
        triangles=filled.body.surface.triangles,
        assessment=verdict,
    )
    work.inside = Inside(
        by=options.by,
        shift_mm=float(norms(surface.centroid)),
        off_mm=float(norms(filled.center)),
        wall_mm=filled.wall_mm,
        details=dict(filled.facts),
        notes=filled.notes,
    )
    work.notes += filled.notes
    work.remarks.append(f"{verdict.max_abs_error:.3g} with its center of mass by {options.by}")
    if verdict.max_abs_error > max(method.tolerance, FILE_PROBABILITIES) and not method.is_thrown:
        work.fail(Status.OFF_TARGET)
