"""A die that keeps the shape of a surface: its solid made fit to print, and what its file is like
beside its probabilities: quality, how far it was changed, what is wrong and what would help."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from manifold3d import Error, Manifold, OpType

from dicedesign.balance.cavity import measure_cavities, with_cavity
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveDie
from dicedesign.errors import InputError
from dicedesign.fabricate.die import Assessment, Design, Solid
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.surfaces.quality import SurfaceQuality, surface_quality
from dicedesign.geometry.surfaces.repair import RepairedMesh
from dicedesign.geometry.surfaces.self_intersections import (
    intersecting_triangles,
    intersection_groups,
)
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Concave, Displacement, HullOfSurface, Status, SurfaceSize
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import (
    FILE_ANGLE,
    FILE_WALL,
    FILLED_GAP,
    LEAST_MARGIN,
    PRINT_TOLERANCE,
    SAME_REST_ANGLE,
)

MARGINS: Final = (0.005, 0.02)
"""Distances that the box that is cut out reaches beyond the triangles that meet, relative to the
diagonal of the body's box, tried in turn."""

RELAXED: Final = {
    Status.OFF_TARGET: "tolerance",
    Status.STRAY: "tolerance",
    Status.TOO_NEAR: "apart_deg",
    Status.TIPPY: "margin_deg",
}
"""Options of `ConcaveOptions` that ask for less where a die has a flaw."""


def solid_of_surface(die: Design, design_result: ConcaveDie, size_mm: float) -> Solid:
    """The plain solid of a die that keeps the shape of a surface, with a largest distance
    `size_mm`, positive, between its points."""
    hollow = design_result.hollow
    center = design_result.after.centroid if hollow is None else hollow.center_of_mass
    scale = size_mm / convex_hull(design_result.after.points).diameter
    placed = design_result.after.with_points((design_result.after.points - center) * scale)
    points, triangles, is_printable = placed.points, placed.triangles, True
    try:
        points, triangles, changes = printable_solid(placed)
        if hollow is not None:
            whole = with_cavity(Surface(points, triangles), hollow.wall * size_mm, np.zeros(3))
            points, triangles = whole.points, whole.triangles
    except InputError as error:
        # Then the die is written as it is, and says so.
        is_printable, changes = False, (str(error),)
    poses = rest_poses(make_body(points, triangles))
    return Solid(
        points=points,
        triangles=triangles,
        poses=poses,
        outcomes=outcome_probabilities(poses, die.directions),
        center_of_mass=None,
        hull_points=(die.hull.vertices - center) * scale,
        changes=changes,
        is_printable=is_printable,
    )


def printable_solid(surface: Surface) -> tuple[Floats, Integers, tuple[str, ...]]:
    """The solid that a surface bounds, cleaned by manifold3d.

    Edges and slivers thinner than `PRINT_TOLERANCE` are collapsed, and points in the middle of flat
    parts with them, so that no point of the surface moves by more. Parts that overlap are joined
    where `_with_overlaps_joined` can.

    Returns
    -------
    (n, 3) points in the unit of the surface and (t, 3) triangles, counter-clockwise seen from
    outside, and what was changed and what is left, one sentence each; no sentence for a surface
    that came through as it was.

    Raises
    ------
    InputError: the surface bounds no solid of positive volume, or falls apart when it is cleaned.
    """
    body = solid(surface.points, surface.triangles)
    joined = _with_overlaps_joined(body, surface.diagonal)
    cleaned = joined.simplify(PRINT_TOLERANCE * surface.diagonal)
    pieces = len(cleaned.decompose()) if cleaned.status() == Error.NoError else 0
    if pieces != 1 or not cleaned.volume() > 0.0:
        raise InputError(
            f"printable solid: expected one piece of positive volume, got {pieces} of "
            f"{cleaned.volume():.3g} from {body.num_tri()} triangles; remesh the surface or deform "
            "it less"
        )
    points, triangles = mesh_of(cleaned)

    def change(before: Manifold, after: Manifold) -> str:
        return f"volume {100.0 * (after.volume() / before.volume() - 1.0):+.2g} %"

    notes = []
    if joined is not body:
        notes.append(
            f"parts that overlap were joined: {joined.num_tri()} triangles from {body.num_tri()}, "
            f"{change(body, joined)}, {body.genus()} handles before and {joined.genus()} after"
        )
    if cleaned.num_tri() != joined.num_tri():
        notes.append(
            f"edges and slivers were taken out: {cleaned.num_tri()} triangles are left of "
            f"{joined.num_tri()}, {change(joined, cleaned)}"
        )
    if cleaned.genus() != joined.genus():
        notes.append(f"handles were closed: {cleaned.genus()} are left of {joined.genus()}")
    crossings = len(intersecting_triangles(points, triangles))
    if crossings:
        notes.append(
            f"the solid still meets itself in {crossings} pairs of triangles: look at it in the "
            "slicer before printing"
        )
    return points, triangles, tuple(notes)


def _with_overlaps_joined(body: Manifold, diagonal: float) -> Manifold:
    """A solid without the places where two parts of it overlap and can be joined.

    No boolean operation of a solid with itself joins its overlapping parts: the result is a
    polynomial of the winding number with integer coefficients, which is even where that is 2. So a
    box around the place is cut out. What is inside it falls into the parts that overlap, where they
    hang together outside it only, and their union with the rest is the solid without the overlap.
    A surface that is pushed through itself from the inside stays as it is.

    diagonal: of the body's box. Returns the solid, the same if nothing was joined.
    """
    points, triangles = mesh_of(body)
    for group in intersection_groups(triangles, intersecting_triangles(points, triangles)):
        corners = points[triangles[group]].reshape(-1, 3)
        for margin in MARGINS:
            lower = corners.min(axis=0) - margin * diagonal
            upper = corners.max(axis=0) + margin * diagonal
            box = Manifold.cube(tuple(upper - lower)).translate(tuple(lower))
            joined = _join(body, box)
            if joined is not None:
                body = joined
                break
    return body


def _join(body: Manifold, box: Manifold) -> Manifold | None:
    """The body with the parts that it has inside a box joined; None if that is of no use."""
    parts = (body ^ box).decompose()
    if len(parts) < 2:
        return None
    inside = Manifold.batch_boolean(parts, OpType.Add)
    if len(intersecting_triangles(*mesh_of(inside))) > 0:
        return None
    joined = body - box + inside
    return joined if joined.status() == Error.NoError and len(joined.decompose()) == 1 else None


def assess_surface(
    design_result: ConcaveDie,
    solid: Solid,
    plain: Assessment,
    wanted: ConcaveOptions,
    repaired: RepairedMesh | None,
) -> tuple[Concave, SurfaceQuality, list[Status]]:
    """The solid of a die that keeps the shape of a surface, and what its file does, against what
    was wanted: a record for the result, its quality, and its flaws, the worst first.

    repaired: the mesh that the surface was made from, where it was repaired.
    """
    body = plain.body
    assert body.triangles is not None
    surface = Surface(body.points, body.triangles)
    # How far corners of the designed hull are from the surface, or the surface is outside of it.
    designed = convex_hull(solid.hull_points)
    middle = designed.vertices.mean(axis=0)
    heights = (plain.poses.hull.vertices - middle) @ designed.normals.T
    outside = float((heights - designed.heights(middle)).max())
    inside = float(distances_from_surface(surface, solid.hull_points).max())
    gap = max(inside, outside, 0.0) / surface.diagonal
    crossings = len(intersecting_triangles(surface.points, surface.triangles))
    before = outcome_probabilities(
        rest_poses(make_body(design_result.before.points, design_result.before.triangles)),
        design_result.directions,
    )
    moved = (
        norms(design_result.after.points - design_result.before.points)
        / design_result.before.diagonal
    )
    quality = surface_quality(design_result.after, design_result.before)
    sentences = list(quality.sentences()) or [
        "no triangle meets another, is folded onto its neighbor, turned over or a sliver"
    ]
    sentences.append(
        f"{crossings or 'no'} pairs of triangles of the printable file meet that should not"
    )
    stretched = quality.distortion
    if stretched is not None:
        sentences.append(
            "95 % of the surface is distorted in shape by a factor of at most "
            f"{stretched['shape_most']:.3g}, and in size by {stretched['size_most']:.3g}"
        )
    cavities = None
    if design_result.hollow is not None and solid.is_printable:
        cavities = measure_cavities(body)
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
    is_thin = False
    if cavities is not None:
        assert wanted.hollow is not None
        is_thin = cavities.wall_mm < wanted.hollow.wall_mm * (1.0 - FILE_WALL)
    # What is nearer, or left earlier, is crowded or unsteady, as of any die.
    apart, margin = plain.outcomes.least_angle, plain.margins.min()
    flaws = {
        Status.LOOSE: gap > FILLED_GAP,
        Status.SELF_INTERSECTING: crossings > 0,
        Status.OPEN: plain.poses.center_of_mass_source != "uniform solid",
        Status.UNPRINTABLE: is_thin or not solid.is_printable,
        Status.TOO_NEAR: SAME_REST_ANGLE <= apart < np.radians(wanted.apart_deg) - FILE_ANGLE,
        Status.TIPPY: LEAST_MARGIN <= margin < np.radians(wanted.margin_deg) - FILE_ANGLE,
    }
    return record, quality, [status for status, holds in flaws.items() if holds]


def advise_on_surface(
    flaws: Sequence[Status],
    design_result: ConcaveDie,
    record: Concave,
    plain: Assessment,
    method: ConcaveOptions,
) -> Iterator[str]:
    """Flaws of a surface, their sizes and remedies."""
    labels, gap, crossings = plain.target.labels, record.hull.gap, record.self_intersections
    if gap > FILLED_GAP:
        yield f"the hull is off by {gap:.2g} of the diagonal"
    if crossings:
        yield f"{crossings} pairs of triangles meet"
    if {Status.CROWDED, Status.TOO_NEAR} & set(flaws):
        shown = np.flatnonzero(plain.outcomes.main >= 0)
        normals = plain.poses.normals[plain.outcomes.main[shown]]
        pairs = np.stack(np.triu_indices(len(shown), 1))
        angles = np.degrees(angle_between(*normals[pairs]))
        first, second = shown[pairs[:, angles.argmin()]]
        wanted = max(method.apart_deg, np.degrees(SAME_REST_ANGLE))
        yield (
            f"{labels[first]} and {labels[second]} are {angles.min():.3g} degrees apart, wanted "
            f"are {wanted:.3g}"
        )
    if {Status.UNSTEADY, Status.TIPPY} & set(flaws):
        margins = np.degrees(plain.margins)
        wanted = max(method.margin_deg, np.degrees(LEAST_MARGIN))
        for outcome in np.flatnonzero(margins < wanted).tolist():
            yield (
                f"{labels[outcome]} is left at {margins[outcome]:.3g} degrees, wanted are "
                f"{wanted:.3g}"
            )
    done, progress = design_result.progress.attempts, design_result.progress
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
