"""Stage check: the verdict on the file, and what would help a die that did not converge."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.fabricate.die import Assessment, Solid, assess_file
from dicedesign.recipe.planning.stage import STAGES, Stage
from dicedesign.recipe.planning.work import Work
from dicedesign.results.parts import Status

if TYPE_CHECKING:
    from dicedesign.geometry.surfaces.surface import Surface

__all__ = ["check"]

RARE: Final = 1e-5
"""Outcomes below are seldom met exactly: of the shapes that lead there most lose their facets."""

RELAXED: Final = {
    Status.OFF_TARGET: "tolerance",
    Status.STRAY: "tolerance",
    Status.TOO_NEAR: "apart_deg",
    Status.TIPPY: "margin_deg",
}
"""Options of `ConcaveOptions` that ask for less where a die has a flaw."""


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
        flaws += _surface_flaws(work)
    if die.status is not Status.CONVERGED:
        # Its odds are off, as was to be expected.
        flaws = [die.status, *(f for f in flaws if f in (Status.CROWDED, Status.UNSTEADY))]
    work.status = flaws[0] if flaws else Status.CONVERGED
    work.remarks += _remarks(work, flaws, work.design_error)


STAGES.register(
    Stage(
        name="check",
        line="reads die_plain.stl back: its rests, their outcomes, and the verdict",
        rank=50,
        wanted=lambda work: True,
        run=check,
    )
)


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
        yield from _surface_advice(work, flaws)
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
    from dicedesign.geometry.hulls.polygons import facet_inradius

    rests = solid.outcomes.main[solid.outcomes.main >= 0]
    return min(facet_inradius(solid.poses.hull, int(facet)) for facet in solid.poses.facets[rests])


def _surface_flaws(work: Work) -> Iterator[Status]:
    """What is wrong with a die that keeps the shape of a surface, beside its odds. Its quality and
    measures go into `Work.concave`."""
    from dicedesign.balance.cavity import measured_cavities
    from dicedesign.geometry.meshes.body import make_body
    from dicedesign.geometry.sphere import norms
    from dicedesign.geometry.surfaces.quality import surface_quality
    from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
    from dicedesign.geometry.surfaces.surface import Surface
    from dicedesign.rest.outcomes import outcome_odds
    from dicedesign.rest.poses import rest_poses
    from dicedesign.results.parts import Concave, Displacement, HullOfSurface, SurfaceSize
    from dicedesign.tolerances import (
        FILE_ANGLE,
        FILE_WALL,
        FILLED_GAP,
        LEAST_MARGIN,
        SAME_REST_ANGLE,
    )

    made, body, wanted = work.die.reshaped, work.plain.body, work.recipe.method.concave
    assert made is not None
    assert wanted is not None
    assert body.triangles is not None
    surface = Surface(body.points, body.triangles)
    gap = _gap(surface, work)
    crossings = len(intersecting_triangles(surface.points, surface.triangles))
    before = outcome_odds(
        rest_poses(make_body(made.before.points, made.before.triangles)), made.directions
    )
    moved = norms(made.after.points - made.before.points) / made.before.diagonal
    work.quality = surface_quality(made.after, made.before)
    cavities = None
    if made.hollow is not None and work.solid.is_printable:
        cavities = measured_cavities(body)
    work.concave = Concave(
        probabilities_before=tuple(before.odds.tolist()),
        elsewhere_before=before.elsewhere,
        displacement=Displacement(float(moved.mean()), float(moved.max())),
        hull=HullOfSurface(*made.hull_corners, gap),
        surface=SurfaceSize(len(surface.points), len(surface.triangles)),
        quality=tuple(_quality(work, crossings)),
        surface_quality=work.quality.data(),
        self_intersections=crossings,
        cavities=cavities,
        repair=None if work.repaired is None else work.repaired.numbers,
    )
    if gap > FILLED_GAP:
        yield Status.LOOSE
    if crossings > 0:
        yield Status.SELF_INTERSECTING
    if work.plain.poses.center_of_mass_source != "uniform solid":
        yield Status.OPEN
    is_thin = False
    if cavities is not None:
        assert wanted.hollow is not None
        is_thin = cavities.wall_mm < wanted.hollow.wall_mm * (1.0 - FILE_WALL)
    if is_thin or not work.solid.is_printable:
        yield Status.UNPRINTABLE
    # What is nearer, or left earlier, is crowded or unsteady, as of any die.
    apart, margin = work.plain.outcomes.least_angle, work.plain.margins.min()
    if SAME_REST_ANGLE <= apart < np.radians(wanted.apart_deg) - FILE_ANGLE:
        yield Status.TOO_NEAR
    if LEAST_MARGIN <= margin < np.radians(wanted.margin_deg) - FILE_ANGLE:
        yield Status.TIPPY


def _gap(surface: Surface, work: Work) -> float:
    """Over the diagonal: how far corners of the designed hull are from the surface, or the surface
    is outside of that hull."""
    from dicedesign.geometry.hulls.hull import convex_hull
    from dicedesign.geometry.surfaces.distances import distances_from_surface

    corners = work.solid.hull_points
    inside = distances_from_surface(surface, corners).max()
    designed = convex_hull(corners)
    middle = designed.vertices.mean(axis=0)
    heights = (work.plain.poses.hull.vertices - middle) @ designed.normals.T
    outside = (heights - designed.heights(middle)).max()
    return float(max(inside, outside, 0.0)) / surface.diagonal


def _quality(work: Work, crossings: int) -> Iterator[str]:
    """Defects of the deformed surface and of the file, and how far triangles are distorted."""
    assert work.quality is not None
    sentences = list(work.quality.sentences())
    yield from sentences or [
        "no triangle meets another, is folded onto its neighbor, turned over or a sliver"
    ]
    yield f"{crossings or 'no'} pairs of triangles of the printable file meet that should not"
    stretched = work.quality.distortion
    if stretched is not None:
        yield (
            "95 % of the surface is distorted in shape by a factor of at most "
            f"{stretched.shape_most:.3g}, and in size by {stretched.size_most:.3g}"
        )


def _surface_advice(work: Work, flaws: list[Status]) -> Iterator[str]:
    """What is off, by how much, and what would help."""
    from dicedesign.tolerances import FILLED_GAP, LEAST_MARGIN, SAME_REST_ANGLE

    method, made, labels = work.recipe.method.concave, work.die.reshaped, work.target.labels
    assert method is not None
    assert made is not None
    assert work.concave is not None
    gap, crossings = work.concave.hull.gap, work.concave.self_intersections
    if gap > FILLED_GAP:
        yield f"the hull is off by {gap:.2g} of the diagonal"
    if crossings:
        yield f"{crossings} pairs of triangles meet"
    if {Status.CROWDED, Status.TOO_NEAR} & set(flaws):
        first, second, angle = _nearest_outcomes(work.plain)
        wanted = max(method.apart_deg, np.degrees(SAME_REST_ANGLE))
        yield (
            f"{labels[first]} and {labels[second]} are {angle:.3g} degrees apart, wanted are "
            f"{wanted:.3g}"
        )
    if {Status.UNSTEADY, Status.TIPPY} & set(flaws):
        margins = np.degrees(work.plain.margins)
        wanted = max(method.margin_deg, np.degrees(LEAST_MARGIN))
        for outcome in np.flatnonzero(margins < wanted).tolist():
            yield (
                f"{labels[outcome]} is left at {margins[outcome]:.3g} degrees, wanted are "
                f"{wanted:.3g}"
            )
    done, progress = made.progress.attempts, made.progress
    if progress.best is not None:
        yield f"this is the best of {done} attempt{'' if done == 1 else 's'}"
    remedies = ["take another seed, target or surface"]
    if done >= method.attempts:
        remedies.append("allow more with method.concave.attempts")
    elif method.seconds is not None and progress.seconds >= method.seconds:
        remedies.append("allow more with method.concave.seconds")
    relaxed = [name for status, name in RELAXED.items() if status in flaws]
    if relaxed:
        remedies.append(f"ask for less with method.concave.{' or .'.join(dict.fromkeys(relaxed))}")
    yield ", or ".join(remedies)


def _nearest_outcomes(verdict: Assessment) -> tuple[int, int, float]:
    """The two outcomes whose own rests are nearest to each other, of at least two that have one,
    and the angle in degrees."""
    from dicedesign.geometry.sphere import angle_between

    shown = np.flatnonzero(verdict.outcomes.main >= 0)
    normals = verdict.poses.normals[verdict.outcomes.main[shown]]
    angles = angle_between(normals[:, None], normals[None])
    angles[np.tril_indices(len(shown))] = np.inf
    first, second = np.unravel_index(int(angles.argmin()), angles.shape)
    return int(shown[first]), int(shown[second]), float(np.degrees(angles[first, second]))
