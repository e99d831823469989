"""Stages start, numbering, size, export and check: from the starting shape to the checked file of
the die without labels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dicedesign.errors import EngravingError, InputError, LabelRoomError, named
from dicedesign.fabricate.die import Design, assess_file, make_solid
from dicedesign.fabricate.numbering import number_die, spread_labels
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.optimize.starts.shapes import about_centroid
from dicedesign.optimize.starts.start import Task, build_start
from dicedesign.recipe.pipeline import Work
from dicedesign.recipe.recipe import AUTO, Recipe
from dicedesign.results.parts import Status
from dicedesign.tolerances import EQUAL_PROBABILITIES, MOST_MM

if TYPE_CHECKING:
    from dicedesign.fabricate.label_layout import Placement
    from dicedesign.geometry.hulls.hull import ConvexHull

SELDOM_PROBABILITY = 1e-3
"""Probability below which a note says that an outcome hardly ever comes up."""

DOMINANT_PROBABILITY = 0.9
"""Probability above which a note says what a die looks like."""


def make_start(work: Work) -> None:
    """Make the starting shape, or for the concave method the surface.

    Raises InputError if a mesh is unreadable or has too few rests, the center of mass is outside
    the shape, a symmetry does not permute its facets or maps labels to less probable ones, the
    surface is not closed, not one solid, convex or nearly a sphere, the die does not suit the
    table, or the art of a label is invalid.
    """
    recipe, paper = work.recipe, work.recipe.method.paper
    labels, probabilities = work.target.labels, work.target.probabilities
    if probabilities.max() > DOMINANT_PROBABILITY:
        work.notes.append(
            f"{labels[probabilities.argmax()]} comes up in {100.0 * probabilities.max():.4g} % of "
            "throws, as its side is by far the largest: the die is flat like a coin or long like a "
            "needle"
        )
    if probabilities.min() < SELDOM_PROBABILITY:
        work.notes.append(
            f"{labels[probabilities.argmin()]} comes up once in {1.0 / probabilities.min():,.0f} "
            "throws, so hardly ever, as its side is small"
        )
    if recipe.method.concave is not None:
        _make_surface(work, recipe.method.concave.points)
    else:
        _make_shape(work)
    if paper is not None and paper.finish != "none":
        defaults, weights = type(paper.weights)().as_dict(), paper.weights.as_dict()
        changed = [name for name, weight in weights.items() if weight != defaults[name]]
        if changed:
            work.notes.append(
                f"method.paper.weights: {', '.join(changed)}: the exact finish ignores them; "
                "write finish: none to skip it, or set method.paper.prefer"
            )
    if recipe.engrave is not None:
        from dicedesign.fabricate.label_art import label_arts

        # Raises if the art of a label is invalid.
        for label in work.target.labels:
            label_arts(label, recipe.engrave, work.target.labels)


def _make_surface(work: Work, points: int | None) -> None:
    """Read the surface and remesh it to a number of points, None to keep its own."""
    from dicedesign.geometry.surfaces.closed_surface import decimate, refine, require_dents
    from dicedesign.geometry.surfaces.repair import FINEST, MOST_POINTS

    start = work.recipe.start
    assert start.kind.surface is not None
    most = MOST_POINTS if points is None else max(FINEST, points)
    source = start.kind.surface(start.options, most)
    work.surface, work.repaired = source.surface, source.repair
    work.notes += source.notes
    extent = float(np.ptp(source.surface.points, axis=0).max())
    if extent < 1.0 and start.mesh is not None:
        work.notes.append(
            f"{start.mesh.path}: {extent:.3g} long, so probably in meters, not millimeters; "
            f"whatever its unit, the die gets a size of {work.recipe.size_mm:g} mm"
        )
    require_dents(source.surface)
    if points is not None:
        remesh = refine if len(source.surface.points) < points else decimate
        work.surface, note = remesh(source.surface, points)
        work.notes.append(note)


def _make_shape(work: Work) -> None:
    """Make the starting shape, after a check of the table of a thrown die."""
    recipe, options, faces = work.recipe, work.recipe.method.options, len(work.target.face_labels)
    center = None if recipe.center_of_mass is None else np.array(recipe.center_of_mass)
    if recipe.method.is_thrown:
        from dicedesign.throws.engines import require_engine
        from dicedesign.throws.momentum_model import momentum_model
        from dicedesign.throws.tables import load_table

        with named("method.exact.table"):
            table = load_table(options.table_with_hand)
            momentum_model(options.table_with_hand)
        # Raises if the die is too large; its radius is at least half of its size.
        replace(table, size=1e-3 * recipe.size_mm)
        if options.refine is not None:
            require_engine(options.refine.engine)
    elif recipe.compares_faces:
        from dicedesign.throws.momentum_model import momentum_model

        with named("method.exact.table"):
            momentum_model(options.table_with_hand)
    start = build_start(recipe.start.name, recipe.start.options, Task(faces, recipe.seed, center))
    if start is None:
        return
    directions: Any = getattr(start, "directions", None)
    shape = np.shape(directions)
    if shape != (faces, 3):
        raise InputError(
            f"start.{recipe.start.name}: expected a Start with a direction for each of the "
            f"{faces} outcomes, got {type(start).__name__} with directions of shape {shape}; "
            "correct the extension"
        )
    if recipe.symmetry is not None:
        # Every symmetry of a body fixes its centroid.
        start = about_centroid(start)
        if recipe.symmetry != AUTO:
            check_orbits(recipe, start.directions)
    work.start = start
    work.notes += start.notes


def check_orbits(recipe: Recipe, directions: np.ndarray) -> None:
    """Raise InputError if the symmetry maps a label to one of another probability."""
    from dicedesign.optimize.coordinates import orbits_of_directions

    group, target = recipe.group(), recipe.target.target()
    assert group is not None
    face = np.array(recipe.face_of_direction())
    first: dict[int, int] = {}
    for orbit, number in zip(orbits_of_directions(directions, group), face, strict=True):
        other, labels = first.setdefault(int(orbit), int(number)), target.face_labels
        probabilities = target.face_probabilities[[number, other]]
        if abs(probabilities[0] - probabilities[1]) > EQUAL_PROBABILITIES * probabilities[1]:
            raise InputError(
                f"symmetry: expected labels {labels[other]} and {labels[number]} to "
                f"be equally probable, as {recipe.symmetry} maps their facets to each other, "
                f"got {probabilities[1]:.6g} and {probabilities[0]:.6g}; change the assignment, "
                "or take a smaller group"
            )


LARGE_MM = 100.0
"""Size above which a note suggests a smaller die."""

RARE_PROBABILITY = 1e-5
"""Probability below which outcomes often lose their facet."""


def assign_numbers(work: Work) -> None:
    """Reassign equally probable faces by the recipe's numbering, if each has a facet."""
    die, target = work.die, work.target
    solid = make_solid(die, work.recipe.size_mm)
    main = solid.outcomes.main
    if (main < 0).any():
        work.notes.append("numbering: skipped, as an outcome has no facet")
        return
    facets, probabilities = solid.poses.facets[main], target.face_probabilities
    if target.wanted[1] is not None:
        # Faces that share freely may differ.
        probabilities = solid.poses.probabilities[main]
    labels, style = target.face_labels, work.recipe.chosen_numbering
    if style == "given":
        # Of repeated labels.
        order = spread_labels(solid.poses.normals[main], labels, probabilities)
        work.die = die.reorder(np.argsort(order))
        return
    order, note = number_die(solid.poses.hull, facets, labels, probabilities, style)
    work.die = die.reorder(np.argsort(order))
    work.notes.append(note)


ABBREVIATED = 3
"""Number of letters of suggested abbreviations; words of one more stay."""

MOST_LARGER = 1.5
"""Factor up to which a die is enlarged for the details of its labels and the walls between them."""

SURE = 1.05
"""Width of strokes, over the printer's least one, at which corners of letters have that."""

WIDER = 1.25
"""Margin of labels, over the printer's wall, where one that is as wide leaves a thinner wall."""


EVEN_HEIGHTS = 1.2
"""Largest height of a label over the smallest, on dice with several faces an outcome."""


def place_at_size(work: Work, die: Design, size_mm: float) -> list[Placement]:
    """Place the recipe's labels on a design at a size. Raises EngravingError if one has no room."""
    # Only dice with labels need these imports.
    from dicedesign.fabricate.convex_object import core_of
    from dicedesign.fabricate.engraving import place_on_facets

    recipe, solid = work.recipe, make_solid(die, size_mm)
    assert recipe.engrave is not None
    core = core_of(solid.poses, recipe.edges)
    return place_on_facets(solid, core, work.target.face_labels, recipe.engrave)[1]


def enlarge(work: Work) -> None:
    """Make the labels of a die fit and suit the printer: where that needs a larger die, by labels
    as fine as the printer makes, and then by the smallest whole number of millimeters; and widen
    margins until the walls between pockets suit it too."""
    given = work.recipe
    engrave, printing = given.engrave, given.print
    assert engrave is not None
    digit_mm, least, finer = engrave.min_height_mm, 0.0, list[dict[str, Any]]()
    if printing is not None and engrave.style == "engraved":
        printer = printing.selected_printer
        least = printer.wall_mm
        small: dict[str, Any] = {
            "margin_mm": min(engrave.margin_mm, printer.ridge_mm),
            "min_height_mm": min(digit_mm, printer.letter_mm),
        }
        wide = {"stroke_mm": max(engrave.stroke_mm, round(SURE * printer.groove_mm, 3))}
        narrow = {"narrow": True}
        shallow = {"depth_mm": min(engrave.depth_mm, printer.groove_depth_mm)}
        finer = [small | wide, small | narrow, small | wide | narrow | shallow]

    def fit(changes: dict[str, Any]) -> _FittingLabels:
        work.recipe = given.model_copy(update={"engrave": replace(engrave, **changes)})
        return _fit_labels(work, digit_mm)

    try:
        chosen, best = dict[str, Any](), fit({})
    except EngravingError:
        # No size helps; the stage engrave reports the error.
        return
    for changes in finer:
        if best.size_mm <= given.size_mm and best.is_fine:
            break
        with suppress(EngravingError):
            other = fit(changes)
            is_smaller = other.is_fine >= best.is_fine and other.size_mm < best.size_mm
            if is_smaller and other.wall_mm >= min(best.wall_mm, least):
                chosen, best = changes, other
    for margin in (least, WIDER * least):
        if max(best.wall_mm, chosen.get("margin_mm", engrave.margin_mm) / WIDER) >= least:
            break
        with suppress(EngravingError):
            changes = chosen | {"margin_mm": margin}
            other = fit(changes)
            if other.size_mm <= MOST_LARGER * given.size_mm and other.wall_mm > best.wall_mm:
                chosen, best = changes, other
    size_mm, heights = best.size_mm, [one.height for one in best.placements]
    if work.target.has_repeated_labels and heights:
        # The labels of one outcome look alike.
        most = max(round(EVEN_HEIGHTS * min(heights), 2), engrave.min_height_mm)
        chosen = chosen | {"max_height_mm": min(engrave.max_height_mm, most)}
    hint, target = "", work.target
    short = {
        each: each[:ABBREVIATED] if each.isalpha() and len(each) > ABBREVIATED + 1 else each
        for each in target.labels
    }
    if (
        size_mm > given.size_mm
        and len(set(short.values())) == len(short)
        and list(short.values()) != list(short)
    ):
        work.recipe = given
        work.target = replace(target, face_labels=tuple(short[one] for one in target.face_labels))
        with suppress(EngravingError):
            short_mm = max(_fit_labels(work, digit_mm).size_mm, given.size_mm)
            if short_mm < size_mm:
                first = ", ".join(list(short.values())[:3])
                hint = f"; {first}, ... would fit at {short_mm:g} mm"
    work.recipe, work.target = given, target
    if size_mm > MOST_MM:
        return
    size_mm = max(size_mm, given.size_mm)
    update = {"engrave": replace(engrave, **chosen), "size_mm": size_mm}
    work.recipe = given.model_copy(update=update)
    changed = [
        f"{name}: {value}"
        for name, value in chosen.items()
        if value != getattr(engrave, name) and name != "max_height_mm"
    ]
    if changed and printing is not None:
        work.notes.append(
            f"engrave: {', '.join(changed)}, so that labels and the walls between pockets suit "
            f"{printing.printer}"
        )
    if given.size_mm < size_mm:
        note = f"size_mm: {size_mm:g}, so that {best.reason}{hint}"
        if size_mm > LARGE_MM:
            note += "; for a smaller die join rare outcomes, shorten labels or try another seed"
        work.notes.append(note)


@dataclass(frozen=True, eq=False)
class _FittingLabels:
    """Labels at the size where they fit.

    Attributes
    ----------
    size_mm: above `MOST_MM` if none suits. reason: for the size.
    is_fine: whether all details suit the printer.
    placements: of the labels; hull: of the die in mm; depth: of pockets.
    """

    size_mm: float
    reason: str
    is_fine: bool
    placements: list[Placement]
    hull: ConvexHull
    depth: float

    @cached_property
    def wall_mm(self) -> float:
        """Thickness of the thinnest wall under the labels."""
        # Only dice with labels need it.
        from dicedesign.fabricate.printability import walls_under

        return min(walls_under(self.placements, self.depth, self.hull), default=0.0)


def _fit_labels(work: Work, digit_mm: float) -> _FittingLabels:
    """Find the size at which labels fit. Raises EngravingError if no size helps.

    digit_mm: least height of labels of one character.
    """
    # Only dice with labels need it.
    from dicedesign.fabricate.printability import least_details, narrowest_stroke

    recipe = work.recipe
    engrave, size_mm, reason = recipe.engrave, recipe.size_mm, "the labels fit"
    assert engrave is not None
    place = partial(place_at_size, work, work.die)

    def lack(placements: list[Placement]) -> float:
        """Least width that prints over the width of the finest detail."""
        single = [digit_mm / one.height for one in placements if len(one.text) == 1]
        if recipe.print is None:
            return max(single, default=0.0)
        sections = {one.text: one for one in sorted(placements, key=lambda one: -one.height)}
        widths = [
            (least, narrowest_stroke(one.section(), side))
            for one in sections.values()
            for least, side in least_details(recipe.print.selected_printer, engrave)
        ]
        ratios = [least / width for least, width in widths if width is not None]
        return max(single + ratios, default=0.0)

    try:
        placements = place(size_mm)
    except LabelRoomError as error:
        size_mm = float(math.ceil(error.size_mm))
        placements = [] if size_mm > MOST_MM else place(size_mm)
    most, factor = min(MOST_LARGER * size_mm, MOST_MM), lack(placements)
    is_fine = factor <= 1.0
    while factor > 1.0 and math.ceil(factor * size_mm) <= most:
        larger = float(math.ceil(factor * size_mm))
        placements, before = place(larger), factor
        factor = lack(placements)
        if factor >= before:
            placements = place(size_mm)
            break
        size_mm = larger
    if recipe.print is not None and factor <= 1.0 and not is_fine:
        reason += f", and their details suit {recipe.print.printer}"
    hull = make_solid(work.die, size_mm).poses.hull
    is_fine = factor <= 1.0
    return _FittingLabels(size_mm, reason, is_fine, placements, hull, engrave.depth_mm)


def export(work: Work) -> None:
    """Scale the die to its size, clean a surface for printing, and make die_plain.stl."""
    if work.die.reshaped is None:
        work.solid = make_solid(work.die, work.recipe.size_mm)
    else:
        # It imports manifold3d, which no convex die needs.
        from dicedesign.fabricate.surface_assessment import solid_of_surface

        work.solid = solid_of_surface(work.die, work.die.reshaped, work.recipe.size_mm)
    work.notes += work.solid.changes
    work.files["die_plain.stl"] = stl_bytes(work.solid)


def check(work: Work) -> None:
    """Read die_plain.stl back, and set status and remarks."""
    die, solid = work.die, work.solid
    data = work.files["die_plain.stl"]
    work.plain = assess_file(
        data, die.directions, work.target, solid.center_of_mass, die.prior, die.within
    )
    if die.prior is not None:
        work.notes.append(
            f"all probabilities are under the prior {work.recipe.prior}, in the frame of "
            "die_plain.stl and die.stl; die_oriented.stl and other formats may be rotated"
        )
    tolerance = None if work.recipe.method.is_thrown else work.recipe.method.tolerance
    flaws = list(work.plain.flaws(tolerance))
    if die.reshaped is not None:
        from dicedesign.fabricate.surface_assessment import assess_surface

        work.concave, work.quality, more = assess_surface(
            die, solid, work.plain, work.recipe.method.options, work.repaired
        )
        flaws += more
    if die.status is not Status.CONVERGED:
        # Other flaws follow from a design that did not converge.
        flaws = [die.status, *(f for f in flaws if f in (Status.CROWDED, Status.UNSTEADY))]
    work.status = flaws[0] if flaws else Status.CONVERGED
    work.remarks += _remarks(work, flaws)


def _remarks(work: Work, flaws: list[Status]) -> Iterator[str]:
    """Yield flaws, errors and advice."""
    verdict, recipe, designed = work.plain, work.recipe, f"{work.design_error:.3g}"
    summary = "; ".join(status.value for status in flaws) or Status.CONVERGED.value
    if recipe.method.is_thrown:
        yield (
            f"{summary} by the momentum model; max |p - q| is {designed} in the corrected "
            "momentum model"
        )
    else:
        yield summary
        error = f"{verdict.max_abs_error:.3g}"
        yield f"max |p - q| is {error} in die_plain.stl, {designed} before rounding"
    elsewhere = verdict.outcomes.elsewhere
    if elsewhere > recipe.method.tolerance or work.die.reshaped is not None:
        yield f"{elsewhere:.3g} of the probability is on rests without an outcome"
    missing = int((verdict.outcomes.main < 0).sum())
    if missing:
        yield f"{missing} outcomes have no facet to rest on"
    if flaws and work.die.reshaped is not None:
        from dicedesign.fabricate.surface_assessment import advise_on_surface

        assert work.concave is not None
        yield from advise_on_surface(
            flaws, work.die.reshaped, work.concave, verdict, recipe.method.options
        )
    elif flaws:
        yield from _advice(work, flaws)
    yield from recipe.warnings()


def _advice(work: Work, flaws: list[Status]) -> Iterator[str]:
    """Yield advice on a convex die that did not converge."""
    method, verdict, solid = work.recipe.method, work.plain, work.solid
    rarest = float(work.target.probabilities.min())
    if (work.die.starts or 1) > 1:
        yield f"this is the best of {work.die.starts} starting shapes"
    if Status.CROWDED in flaws:
        yield (
            f"the nearest are {np.degrees(verdict.outcomes.least_angle):.2g} degrees apart; try "
            "another start, assignment or seed"
        )
    if Status.UNSTEADY in flaws:
        weakest = int(verdict.margins.argmin())
        yield (
            f"{work.target.labels[weakest]} tips over at "
            f"{np.degrees(verdict.margins[weakest]):.2g} degrees; try another seed, or join rare "
            "outcomes"
        )
    if method.paper is not None and method.paper.finish == "none":
        yield "finish: exact would improve it"
    if Status.TOO_SMALL in flaws:
        rests = solid.outcomes.main[solid.outcomes.main >= 0]
        facets = solid.poses.facets[rests].tolist()
        circle = min(facet_inradius(solid.poses.hull, facet) for facet in facets)
        yield f"the smallest circle has a radius of {circle:.3g} mm"
    if method.exact is None:
        return
    if Status.TIME_LIMIT in flaws:
        yield "allow more with method.exact.seconds"
    if Status.STEP_LIMIT in flaws:
        yield "method.exact.evaluations limits them"
    if method.exact.coordinates == "vertices":
        yield "facets of more than three sides break under coordinates: vertices; facets keeps them"
    if rarest < RARE_PROBABILITY:
        yield (
            f"an outcome with probability {rarest:.2g} rarely gets its own facet: join or "
            "remove rare outcomes"
        )
