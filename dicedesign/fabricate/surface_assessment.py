"""Printable solid of a concave die, which keeps the shape of a surface, and the assessment of its
file: quality, displacement, flaws and remedies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from manifold3d import Error

from dicedesign.balance.cavity import measure_cavities, with_cavity
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveDie
from dicedesign.errors import InputError
from dicedesign.fabricate.die import Assessment, Design, Solid
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.surfaces.quality import SurfaceQuality, surface_quality
from dicedesign.geometry.surfaces.repair import RepairedMesh
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Concave, Displacement, HullOfSurface, Status, SurfaceSize
from dicedesign.tolerances import (
    FILE_ANGLE,
    FILE_WALL,
    FILLED_GAP,
    LEAST_MARGIN,
    PRINT_TOLERANCE,
    SAME_REST_ANGLE,
)

RELAXED = {
    Status.OFF_TARGET: "tolerance",
    Status.STRAY: "tolerance",
    Status.TOO_NEAR: "apart_deg",
    Status.TIPPY: "margin_deg",
}
"""Options of `ConcaveOptions` to relax for a flaw."""


def solid_of_surface(die: Design, design_result: ConcaveDie, size_mm: float) -> Solid:
    """Make the plain solid of a concave die.

    size_mm: largest distance between two of its points, above 0.
    """
    hollow, after = design_result.hollow, design_result.after
    center = after.centroid if hollow is None else hollow.center_of_mass
    scale = size_mm / convex_hull(after.points).diameter
    surface, is_printable = after.with_points((after.points - center) * scale), True
    try:
        surface, changes = printable_solid(surface)
        if hollow is not None:
            surface = with_cavity(surface, hollow.wall * size_mm, np.zeros(3))
    except InputError as error:
        # Then the die is written as it is, and says so.
        is_printable, changes = False, (str(error),)
    poses = rest_poses(surface)
    return Solid(
        points=surface.points,
        triangles=surface.triangles,
        poses=poses,
        outcomes=outcome_probabilities(poses, die.directions, die.outcome_of, die.within),
        center_of_mass=None,
        hull_points=(die.hull.vertices - center) * scale,
        changes=changes,
        is_printable=is_printable,
    )


def printable_solid(surface: Surface) -> tuple[Surface, tuple[str, ...]]:
    """Clean the solid that a surface bounds by manifold3d.

    Edges and slivers thinner than `PRINT_TOLERANCE` are collapsed, and points in the middle of flat
    parts with them, so that no point of the surface moves by more.

    Returns
    -------
    Surface of the solid, and a sentence for each change and for what is left; none for a surface
    that did not change.

    Raises
    ------
    InputError: the surface bounds no solid of positive volume, or falls apart when it is cleaned.
    """
    body = solid(surface)
    cleaned = body.simplify(PRINT_TOLERANCE * surface.diagonal)
    pieces = len(cleaned.decompose()) if cleaned.status() == Error.NoError else 0
    if pieces != 1 or not cleaned.volume() > 0.0:
        raise InputError(
            f"printable solid: expected one piece of positive volume, got {pieces} of "
            f"{cleaned.volume():.3g} from {body.num_tri()} triangles; remesh the surface or deform "
            "it less"
        )
    clean, notes = mesh_of(cleaned), []
    if cleaned.num_tri() != body.num_tri():
        notes.append(
            f"edges and slivers were taken out: {cleaned.num_tri()} triangles are left of "
            f"{body.num_tri()}, volume {100.0 * (cleaned.volume() / body.volume() - 1.0):+.2g} %"
        )
    if cleaned.genus() != body.genus():
        notes.append(f"handles were closed: {cleaned.genus()} are left of {body.genus()}")
    crossings = len(intersecting_triangles(clean.points, clean.triangles))
    if crossings:
        notes.append(
            f"the solid still intersects itself in {crossings} pairs of triangles: look at it in "
            "the slicer before printing"
        )
    return clean, tuple(notes)


def assess_surface(
    die: Design,
    solid: Solid,
    plain: Assessment,
    wanted: ConcaveOptions,
    repaired: RepairedMesh | None,
) -> tuple[Concave, SurfaceQuality, list[Status]]:
    """Assess the file of a concave die: its record for the result, the quality of the designed
    surface, and its flaws, the worst first.

    plain: rests and outcomes of the file; repaired: the mesh that the surface was made from, if it
    was repaired.
    """
    assert die.reshaped is not None
    design_result, surface = die.reshaped, plain.body.surface
    # Distance of corners of the designed hull from the surface, and of the surface outside of it.
    designed = convex_hull(solid.hull_points)
    outside = -float(designed.least_depths(plain.poses.hull.vertices).min())
    inside = float(distances_from_surface(surface, solid.hull_points).max())
    gap = max(inside, outside, 0.0) / surface.diagonal
    crossings = len(intersecting_triangles(surface.points, surface.triangles))
    start, after = design_result.before, design_result.after
    faces = design_result.directions, plain.target.outcome_of_face
    before = outcome_probabilities(rest_poses(start), *faces, die.within)
    moved = norms(after.points - start.points) / start.diagonal
    quality = surface_quality(after, start)
    sentences = list(quality.sentences()) or [
        "no triangle meets another, is folded onto its neighbor, turned over or a sliver"
    ]
    sentences.append(
        f"{crossings or 'no'} pairs of triangles of the printable file meet that should not"
    )
    if quality.distortion is not None:
        sentences.append(
            "95 % of the surface is distorted in shape by a factor of at most {shape_most:.3g}, "
            "and in size by {size_most:.3g}".format_map(quality.distortion)
        )
    if quality.turns is not None:
        sentences.append(quality.turns.sentence)
    cavities, is_printable = None, solid.is_printable
    if design_result.hollow is not None and solid.is_printable:
        assert wanted.hollow is not None
        cavities = measure_cavities(surface)
        is_printable = cavities.wall_mm >= wanted.hollow.wall_mm * (1.0 - FILE_WALL)
    record = Concave(
        probabilities_before=tuple(before.probabilities.tolist()),
        elsewhere_before=before.elsewhere,
        displacement=Displacement(float(moved.mean()), float(moved.max())),
        hull=HullOfSurface(*design_result.hull_corners, gap),
        surface=SurfaceSize(len(surface.points), len(surface.triangles)),
        quality=tuple(sentences),
        surface_quality=quality.data(),
        self_intersections=crossings,
        cavities=cavities,
        repair=None if repaired is None else repaired.numbers,
    )
    # Outcomes that are nearer, or left earlier, are crowded or unsteady, as of any die.
    apart, margin = plain.outcomes.least_angle, plain.margins.min()
    least_apart, least_margin = np.radians(wanted.least_angles)
    flaws = {
        Status.LOOSE: gap > FILLED_GAP,
        Status.SELF_INTERSECTING: crossings > 0,
        Status.OPEN: plain.poses.center_of_mass_source != "uniform solid",
        Status.UNPRINTABLE: not is_printable,
        Status.TOO_NEAR: SAME_REST_ANGLE <= apart < least_apart - FILE_ANGLE,
        Status.TIPPY: LEAST_MARGIN <= margin < least_margin - FILE_ANGLE,
    }
    return record, quality, [status for status, holds in flaws.items() if holds]


def advise_on_surface(
    flaws: Sequence[Status],
    design_result: ConcaveDie,
    record: Concave,
    plain: Assessment,
    method: ConcaveOptions,
) -> Iterator[str]:
    """Yield the flaws of a concave die, their sizes and remedies."""
    labels, gap, crossings = plain.target.labels, record.hull.gap, record.self_intersections
    if gap > FILLED_GAP:
        yield f"the hull is off by {gap:.2g} of the diagonal"
    if crossings:
        yield f"{crossings} pairs of triangles meet"
    if {Status.CROWDED, Status.TOO_NEAR} & set(flaws):
        shown = np.flatnonzero(plain.outcomes.main >= 0)
        normals = plain.poses.normals[plain.outcomes.main[shown]]
        pairs = np.stack(np.triu_indices(len(shown), 1))
        outcomes = plain.target.outcome_of_face[shown[pairs]]
        pairs = pairs[:, outcomes[0] != outcomes[1]]
        angles = np.degrees(angle_between(*normals[pairs]))
        first, second = shown[pairs[:, angles.argmin()]]
        of_faces = plain.target.face_labels
        wanted = max(method.least_angles[0], np.degrees(SAME_REST_ANGLE))
        yield (
            f"{of_faces[first]} and {of_faces[second]} are {angles.min():.3g} degrees apart, "
            f"wanted are {wanted:.3g}"
        )
    if {Status.UNSTEADY, Status.TIPPY} & set(flaws):
        margins = np.degrees(plain.margins)
        wanted = max(method.least_angles[1], np.degrees(LEAST_MARGIN))
        for outcome in np.flatnonzero(margins < wanted).tolist():
            yield (
                f"{labels[outcome]} tips over at {margins[outcome]:.3g} degrees, wanted are "
                f"{wanted:.3g}"
            )
    progress = design_result.progress
    done = progress.attempts
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
