"""Stages numbering, size, export and check: the solid of a designed die, its file without labels,
and what that does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from dicedesign.errors import EngravingError, LabelRoomError
from dicedesign.fabricate.die import Solid, assess_file, make_solid
from dicedesign.fabricate.label_reading import core_of, place_on_facets
from dicedesign.fabricate.numbering import numbered
from dicedesign.geometry.hulls.polygons import facet_inradius
from dicedesign.geometry.meshes.formats import stl_bytes
from dicedesign.recipe.work import Work
from dicedesign.results.parts import Status
from dicedesign.tolerances import MOST_MM

LARGE_MM: Final = 100.0
"""Beyond this size a die takes long to print, and is hard to throw."""

RARE: Final = 1e-5
"""Outcomes below are seldom met exactly: of the shapes that lead there most lose their facets."""


def number(work: Work) -> None:
    """Number the designed die as the recipe says, where each outcome has a facet."""
    die, target = work.die, work.target
    solid = make_solid(die, work.recipe.size_mm)
    main = solid.outcomes.main
    if (main < 0).any():
        work.notes.append("numbering: an outcome has no facet, so that all stay where they are")
        return
    facets = solid.poses.facets[main]
    order, note = numbered(
        solid.poses.hull, facets, target.labels, target.probabilities, work.recipe.numbering
    )
    # Where each outcome now is.
    place = np.argsort(order)
    work.die = replace(
        die,
        directions=die.directions[place],
        rounds=tuple(
            replace(done, asked=done.asked[place], frequencies=done.frequencies[place])
            for done in die.rounds
        ),
    )
    work.notes.append(note)


def enlarge(work: Work) -> None:
    """Take the smallest whole number of millimetres at which the labels fit, if the recipe's size
    is too small for them; the recipe that is written says so."""
    recipe = work.recipe
    assert recipe.engrave is not None
    try:
        solid = make_solid(work.die, recipe.size_mm)
        core = core_of(solid.poses, recipe.edges)
        place_on_facets(solid.poses, solid.outcomes.main, core, work.target.labels, recipe.engrave)
    except LabelRoomError as error:
        if error.size_mm > MOST_MM:
            return
        size_mm = float(math.ceil(error.size_mm))
        work.recipe = recipe.model_copy(update={"size_mm": size_mm})
        note = f"size_mm: {size_mm:g}, so that the labels fit"
        if size_mm > LARGE_MM:
            note += "; for a smaller die join rare outcomes, shorten labels or try another seed"
        work.notes.append(note)
    except EngravingError:
        # No size helps; engraving says why.
        pass


def export(work: Work) -> None:
    """Bring the die to its size, clean a surface for printing, and make die_plain.stl."""
    work.solid = make_solid(work.die, work.recipe.size_mm)
    work.notes += work.solid.changes
    work.files["die_plain.stl"] = stl_bytes(work.solid.points, work.solid.triangles)


def check(work: Work) -> None:
    """Read die_plain.stl back and say what it does and what is wrong with it."""
    die, solid = work.die, work.solid
    data = work.files["die_plain.stl"]
    work.plain = assess_file(data, die.directions, work.target, solid.center_of_mass, die.prior)
    if die.prior is not None:
        work.notes.append(
            f"all odds are those under the prior {work.recipe.prior}, whose directions are in the "
            "frame of die_plain.stl and die.stl; die_oriented.stl and other formats may be turned"
        )
    thrown = work.recipe.method.thrown
    tolerance = None if thrown else work.recipe.method.tolerance
    flaws = list(work.plain.flaws(tolerance))
    if die.reshaped is not None:
        # It brings a library of solids along, which no convex die needs.
        from dicedesign.fabricate.surface_assessment import assess_surface

        assert work.recipe.method.concave is not None
        found = assess_surface(
            die.reshaped, solid, work.plain, work.recipe.method.concave, work.repaired
        )
        work.concave, work.quality = found.record, found.quality
        flaws += found.flaws
    if die.status is not Status.CONVERGED:
        # Its odds are off, as was to be expected.
        flaws = [die.status, *(f for f in flaws if f in (Status.CROWDED, Status.UNSTEADY))]
    work.status = flaws[0] if flaws else Status.CONVERGED
    work.remarks += _remarks(work, flaws, work.design_error)


def _remarks(work: Work, flaws: list[Status], designed: float) -> Iterator[str]:
    verdict, recipe = work.plain, work.recipe
    told = [status.value for status in flaws] or [Status.CONVERGED.value]
    if recipe.method.thrown:
        yield (
            f"{'; '.join(told)} by the momentum model; max |p - q| is {designed:.3g} of the odds "
            "that it was asked for"
        )
    else:
        yield "; ".join(told)
        yield (
            f"max |p - q| is {verdict.max_abs_error:.3g} in the file, {designed:.3g} as designed"
        )
    elsewhere = verdict.outcomes.elsewhere
    if elsewhere > recipe.method.tolerance or work.die.reshaped is not None:
        yield f"{elsewhere:.3g} of the probability lies on rests without an outcome"
    missing = int((verdict.outcomes.main < 0).sum())
    if missing:
        yield f"{missing} outcomes have no facet to rest on"
    if flaws:
        yield from _advice(work, flaws)
    yield from recipe.doubts()


def _advice(work: Work, flaws: list[Status]) -> Iterator[str]:
    """What would help a die that did not converge."""
    method, die, verdict = work.recipe.method, work.die, work.plain
    if die.reshaped is not None:
        from dicedesign.fabricate.surface_assessment import advise_on_surface

        assert work.concave is not None
        assert method.concave is not None
        yield from advise_on_surface(flaws, die.reshaped, work.concave, verdict, method.concave)
        return
    if (die.starts or 1) > 1:
        yield f"this is the best of {die.starts} starting shapes"
    if Status.TIME_LIMIT in flaws and method.exact is not None:
        yield "allow more with method.exact.seconds"
    if Status.STEP_LIMIT in flaws and method.exact is not None:
        yield "method.exact.evaluations is their number"
    if Status.CROWDED in flaws:
        yield (
            f"the nearest are {np.degrees(verdict.outcomes.least_angle):.2g} degrees apart; try "
            "another start, assignment or seed"
        )
    if Status.UNSTEADY in flaws:
        weakest = int(verdict.margins.argmin())
        yield (
            f"{work.target.labels[weakest]} is left at {np.degrees(verdict.margins[weakest]):.2g} "
            "degrees; try another seed, or join what is so rare"
        )
    if method.paper is not None and method.paper.finish == "none":
        yield "finish: exact would go on from here"
    if method.exact is not None and method.exact.coordinates == "vertices":
        yield "facets of more than three sides break under coordinates: vertices; facets keeps them"
    if Status.TOO_SMALL in flaws:
        yield f"the smallest circle has a radius of {_smallest_circle(work.solid):.3g} mm"
    smallest = float(work.target.probabilities.min())
    if method.exact is not None and smallest < RARE:
        yield (
            f"an outcome of {smallest:.2g} is hard to give a facet of its own: leave out or join "
            "what is so rare"
        )


def _smallest_circle(solid: Solid) -> float:
    rests = solid.outcomes.main[solid.outcomes.main >= 0]
    return min(facet_inradius(solid.poses.hull, int(facet)) for facet in solid.poses.facets[rests])
