"""What the file of a die that keeps the shape of a surface is like beside its probabilities: its
quality, how far it was changed, what is wrong with it and what would help."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dicedesign.balance.cavity import measured_cavities
from dicedesign.concave.options import ConcaveOptions
from dicedesign.concave.result import ConcaveDie
from dicedesign.fabricate.die import Assessment, Solid
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.sphere import angle_between, norms
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.surfaces.quality import SurfaceQuality, surface_quality
from dicedesign.geometry.surfaces.repair import RepairedMesh
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.triangles import Surface
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Concave, Displacement, HullOfSurface, Status, SurfaceSize
from dicedesign.tolerances import (
    FILE_ANGLE,
    FILE_WALL,
    FILLED_GAP,
    LEAST_MARGIN,
    SAME_REST_ANGLE,
)

RELAXED: Final = {
    Status.OFF_TARGET: "tolerance",
    Status.STRAY: "tolerance",
    Status.TOO_NEAR: "apart_deg",
    Status.TIPPY: "margin_deg",
}
"""Options of `ConcaveOptions` that ask for less where a die has a flaw."""


@dataclass(frozen=True)
class SurfaceAssessment:
    """A finished surface: `record` for the result, its quality, and its flaws, the worst first."""

    record: Concave
    quality: SurfaceQuality
    flaws: tuple[Status, ...]


def assess_surface(
    made: ConcaveDie,
    solid: Solid,
    plain: Assessment,
    wanted: ConcaveOptions,
    repaired: RepairedMesh | None,
) -> SurfaceAssessment:
    """The solid of a die that keeps the shape of a surface, and what its file does, against what
    was wanted.

    repaired: the mesh that the surface was made from, where it was repaired.
    """
    body = plain.body
    assert body.triangles is not None
    surface = Surface(body.points, body.triangles)
    gap = _gap(surface, solid, plain)
    crossings = len(intersecting_triangles(surface.points, surface.triangles))
    before = outcome_odds(
        rest_poses(make_body(made.before.points, made.before.triangles)), made.directions
    )
    moved = norms(made.after.points - made.before.points) / made.before.diagonal
    quality = surface_quality(made.after, made.before)
    is_hollow = made.hollow is not None and solid.is_printable
    record = Concave(
        probabilities_before=tuple(before.odds.tolist()),
        elsewhere_before=before.elsewhere,
        displacement=Displacement(float(moved.mean()), float(moved.max())),
        hull=HullOfSurface(*made.hull_corners, gap),
        surface=SurfaceSize(len(surface.points), len(surface.triangles)),
        quality=tuple(_describe_quality(quality, crossings)),
        surface_quality=quality.data(),
        self_intersections=crossings,
        cavities=measured_cavities(body) if is_hollow else None,
        repair=None if repaired is None else repaired.numbers,
    )
    return SurfaceAssessment(record, quality, tuple(_flaws(record, solid, plain, wanted)))


def _flaws(
    record: Concave, solid: Solid, plain: Assessment, wanted: ConcaveOptions
) -> Iterator[Status]:
    if record.hull.gap > FILLED_GAP:
        yield Status.LOOSE
    if record.self_intersections > 0:
        yield Status.SELF_INTERSECTING
    if plain.poses.center_of_mass_source != "uniform solid":
        yield Status.OPEN
    is_thin = False
    if record.cavities is not None:
        assert wanted.hollow is not None
        is_thin = record.cavities.wall_mm < wanted.hollow.wall_mm * (1.0 - FILE_WALL)
    if is_thin or not solid.is_printable:
        yield Status.UNPRINTABLE
    # What is nearer, or left earlier, is crowded or unsteady, as of any die.
    apart, margin = plain.outcomes.least_angle, plain.margins.min()
    if SAME_REST_ANGLE <= apart < np.radians(wanted.apart_deg) - FILE_ANGLE:
        yield Status.TOO_NEAR
    if LEAST_MARGIN <= margin < np.radians(wanted.margin_deg) - FILE_ANGLE:
        yield Status.TIPPY


def _gap(surface: Surface, solid: Solid, plain: Assessment) -> float:
    """Over the diagonal: how far corners of the designed hull are from the surface, or the surface
    is outside of that hull."""
    corners = solid.hull_points
    inside = distances_from_surface(surface, corners).max()
    designed = convex_hull(corners)
    middle = designed.vertices.mean(axis=0)
    heights = (plain.poses.hull.vertices - middle) @ designed.normals.T
    outside = (heights - designed.heights(middle)).max()
    return float(max(inside, outside, 0.0)) / surface.diagonal


def _describe_quality(quality: SurfaceQuality, crossings: int) -> Iterator[str]:
    """Defects of the deformed surface and of the file, and how far triangles are distorted."""
    sentences = list(quality.sentences())
    yield from sentences or [
        "no triangle meets another, is folded onto its neighbor, turned over or a sliver"
    ]
    yield f"{crossings or 'no'} pairs of triangles of the printable file meet that should not"
    stretched = quality.distortion
    if stretched is not None:
        yield (
            "95 % of the surface is distorted in shape by a factor of at most "
            f"{stretched['shape_most']:.3g}, and in size by {stretched['size_most']:.3g}"
        )


def advise_on_surface(
    flaws: Sequence[Status],
    made: ConcaveDie,
    record: Concave,
    plain: Assessment,
    method: ConcaveOptions,
) -> Iterator[str]:
    """What is off, by how much, and what would help."""
    labels, gap, crossings = plain.target.labels, record.hull.gap, record.self_intersections
    if gap > FILLED_GAP:
        yield f"the hull is off by {gap:.2g} of the diagonal"
    if crossings:
        yield f"{crossings} pairs of triangles meet"
    if {Status.CROWDED, Status.TOO_NEAR} & set(flaws):
        first, second, angle = _nearest_outcomes(plain)
        wanted = max(method.apart_deg, np.degrees(SAME_REST_ANGLE))
        yield (
            f"{labels[first]} and {labels[second]} are {angle:.3g} degrees apart, wanted are "
            f"{wanted:.3g}"
        )
    if {Status.UNSTEADY, Status.TIPPY} & set(flaws):
        margins = np.degrees(plain.margins)
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


def _nearest_outcomes(plain: Assessment) -> tuple[int, int, float]:
    """The two outcomes whose own rests are nearest to each other, of at least two that have one,
    and the angle in degrees."""
    shown = np.flatnonzero(plain.outcomes.main >= 0)
    normals = plain.poses.normals[plain.outcomes.main[shown]]
    angles = angle_between(normals[:, None], normals[None])
    angles[np.tril_indices(len(shown))] = np.inf
    first, second = np.unravel_index(int(angles.argmin()), angles.shape)
    return int(shown[first]), int(shown[second]), float(np.degrees(angles[first, second]))
