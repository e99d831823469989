"""Ways to move a center of mass: cavities, perhaps with drain holes, and infill.

Lengths are in millimeters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from manifold3d import Manifold, OpType
from scipy.stats import qmc

from dicedesign.balance.cavity import (
    beyond_plane,
    large_parts,
    least_wall,
    measure_cavities,
    reach,
    weigh_part,
    with_cavity,
    within_walls,
)
from dicedesign.balance.options import BodyMaterial
from dicedesign.balance.regions import Stability, is_shifted, spread_evenly
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, shells_of
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.meshes.reading import read_stl, stl_bytes
from dicedesign.geometry.sphere import norms, rotation_between, unit_vectors
from dicedesign.geometry.surfaces.grid_surface import closest_points
from dicedesign.geometry.triangles import Surface, doubled_area_vectors
from dicedesign.runtime.arrays import Floats

PLACES = 3000
"""Number of points on the surface that are candidates for a mouth."""

MAX_TRIED = 40
"""Largest number of candidates whose hole is cut."""

STEEP = 0.85
"""Least cosine of the angle between a hole and the normal at its mouth."""

BEYOND = 0.9
"""Length of a cut beyond the mouth in radii; half as much into the cavity."""

APART = 1.3
"""Least distance of the axis from the corners of the hull, in radii."""

SEGMENTS = 48
"""Number of segments of a hole's circle."""


@dataclass(frozen=True, eq=False)
class Hole:
    """Round hole from the mouth (3,) on the surface along the unit vector `inward` (3,) to a cavity
    at the distance `length_mm`."""

    mouth: Floats
    inward: Floats
    length_mm: float
    diameter_mm: float

    def tube(self, factor: float = 1.0) -> Manifold:
        """Solid to cut out; factor: of the diameter."""
        radius = 0.5 * factor * self.diameter_mm
        before, after = BEYOND * radius, 0.5 * BEYOND * radius
        tube = Manifold.cylinder(before + self.length_mm + after, radius, radius, SEGMENTS)
        turn = rotation_between(np.array([0.0, 0.0, 1.0]), self.inward)
        return tube.transform(np.column_stack([turn, self.mouth - before * self.inward]))


def drain_hole(surface: Surface, cavity: Surface, center: Floats, radius: float) -> Hole:
    """Shortest hole from the outside to a cavity that stays away from the corners of the hull, and
    preferably from the facets on which the body rests.

    surface: of the body; center: (3,) new center of mass. Raises InputError if there is none.
    """
    # Evenly spread points on the surface, with normals.
    vectors = doubled_area_vectors(surface.points, surface.triangles)
    areas = norms(vectors)
    numbers = (np.arange(PLACES) + 0.5) / PLACES
    draws = np.column_stack([numbers, qmc.Halton(2, scramble=False).random(PLACES)])
    which, weights = spread_evenly(areas, draws)
    corners = surface.points[surface.triangles[which]]
    places = (weights[:, :, None] * corners).sum(axis=1)
    normals = vectors[which] / areas[which, None]
    _, feet = closest_points(cavity, places)
    inward, lengths = unit_vectors(feet - places), norms(feet - places)
    hull = convex_hull(surface.points, single_precision=True)
    apart = norms(places[:, None] - hull.vertices[None]).min(axis=1)
    fits = ((inward * normals).sum(axis=1) <= -STEEP) & (apart > APART * radius)
    # Holes on resting facets come last.
    is_rest = Stability(hull).outermost(center)[1] > 0.0
    is_on_rest = (hull.depths(places)[:, is_rest] < 0.1 * radius).any(axis=1)
    order = np.lexsort((lengths, is_on_rest))
    body = solid(surface)
    whole = body.hull().volume()
    for place in order[fits[order]][:MAX_TRIED]:
        hole = Hole(places[place], inward[place], float(lengths[place]), 2.0 * radius)
        left = body - hole.tube()
        if abs(left.hull().volume() - whole) <= 1e-9 * whole and len(left.decompose()) == 1:
            return hole
    raise InputError(
        f"drain_mm: expected room for a hole of {2.0 * radius:g} mm that leaves the corners the "
        "body stands on, got none; reduce drain_mm"
    )


SAFE = 0.95
"""Safety factor of a reach."""

MAX_HOLES = 6

LEAST_PIECE = 1e-3
"""Volume relative to the largest below which a piece of a difference of files is rounding."""

MODIFIER = "_sparse.stl"
"""Suffix of the file name of the part with less infill."""


@dataclass(frozen=True, eq=False)
class MovedCenter:
    """Body with a moved center of mass, by its files as they were read back.

    Attributes
    ----------
    files: contents by suffix of the file name, such as "_sparse.stl"; "" is the body.
    center: (3,) center of mass, by the files with their densities.
    wall_mm: measured least thickness of the walls; None without anything inside.
    facts: plain data about the inside; notes: these facts in sentences.
    """

    files: Mapping[str, bytes]
    center: Floats
    wall_mm: float | None
    facts: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def body(self) -> Body:
        """The body, read back."""
        return read_stl(self.files[""])

    @cached_property
    def sparse(self) -> Body | None:
        """The part with less infill, read back, or None."""
        return read_stl(self.files[MODIFIER]) if MODIFIER in self.files else None


def reachable_shifts(surface: Surface, by: str, material: BodyMaterial) -> ConvexHull:
    """Possible shifts of the center of mass by a way; see `reach`. Raises InputError if the walls
    leave no room."""
    densities = material.infill if by == "infill" else (0.0, 1.0)
    return reach(surface, material.wall_mm, SAFE, densities)


def move_center(surface: Surface, center: Floats, by: str, material: BodyMaterial) -> MovedCenter:
    """Move the center of mass of a solid with float32 coordinates to (3,): by the smallest
    "cavity", or by two densities of "infill". Raises InputError if that is impossible."""
    if by == "infill":
        return _with_two_infills(surface, center, material)
    if not is_shifted(surface, center):
        notes = ("the center of mass is there already",)
        return MovedCenter({"": stl_bytes(surface)}, surface.centroid, None, notes=notes)
    if material.drain_mm is not None:
        return _drain(surface, center, material.wall_mm, 0.5 * material.drain_mm)
    data = stl_bytes(with_cavity(surface, material.wall_mm, center))
    made = measure_cavities(read_stl(data).surface)
    return _describe_cavities(data, made.wall_mm, made.number, made.volume_mm3, made.part)


def _describe_cavities(
    data: bytes, wall: float, number: int, volume: float, part: float, holes: Sequence[Hole] = ()
) -> MovedCenter:
    """Body with cavities, with facts and notes about them."""
    facts: dict[str, Any] = {"cavities": number, "cavity_mm3": volume, "part": part}
    several = f"{number} cavities" if number > 1 else "a cavity"
    notes = [f"{several} of {volume:.4g} mm3, {100.0 * part:.3g} % of the body"]
    if holes:
        facts["drains"] = [
            vars(hole) | {"mouth": hole.mouth.tolist(), "inward": hole.inward.tolist()}
            for hole in holes
        ]
    else:
        notes.append(
            "the cavity is closed: filament leaves it empty, but powder and resin would stay in it"
        )
    for hole in holes:
        place = ", ".join(f"{x:.4g}" for x in hole.mouth)
        notes.append(f"a hole of {hole.diameter_mm:g} mm at {place} drains it")
    return MovedCenter({"": data}, read_stl(data).surface.centroid, wall, facts, tuple(notes))


def _drain(surface: Surface, center: Floats, wall: float, radius: float) -> MovedCenter:
    """Make a cavity with a hole to each of its parts; it is recomputed with each hole."""
    body = solid(surface)
    room, _ = within_walls(surface, wall)
    holes: tuple[Hole, ...] = ()
    for _ in range(MAX_HOLES):
        tubes = [hole.tube() for hole in holes]
        rest, free = _without(body, tubes), _without(room, tubes)
        outer = mesh_of(rest)
        cut = beyond_plane(free, center, outer.volume * (outer.centroid - center))
        if cut is None:
            raise InputError(
                f"drain_mm: expected a hole of {2.0 * radius:g} mm that leaves a cavity, got none "
                "with its center of mass where it is wanted; reduce drain_mm or wall_mm"
            )
        whole, plane = cut
        closed = [
            part
            for part in whole.decompose()
            if not any(tube.min_gap(part, radius) < 1e-6 * radius for tube in tubes)
        ]
        if not closed:
            # Everything beyond the plane; the holes are already cut.
            cavity = rest - room.trim_by_plane(*plane)
            break
        holes += (drain_hole(surface, mesh_of(closed[0]), center, radius),)
    else:
        raise InputError(
            f"drain_mm: expected a cavity of at most {MAX_HOLES} parts to drain, got more; leave "
            "drain_mm out, or reduce wall_mm"
        )
    data = stl_bytes(mesh_of(cavity))
    file = read_stl(data).surface
    shells = int(shells_of(file.triangles).max()) + 1
    if shells > 1:
        raise InputError(
            f"drain_mm: expected a body of one surface, got {shells} with the holes; reduce "
            "drain_mm"
        )
    # What the file lacks, without the holes.
    missing = body - solid(file)
    pieces = _without(missing, [hole.tube(1.05) for hole in holes])
    parts = large_parts(pieces, LEAST_PIECE)
    least = min(least_wall(surface, mesh_of(part)) for part in parts)
    if least < 0.9 * wall:
        raise InputError(
            f"drain_mm: expected walls of {wall:g} beside the holes, got {least:.3g}; reduce "
            "drain_mm"
        )
    volume = float(missing.volume())
    return _describe_cavities(data, least, len(parts), volume, volume / surface.volume, holes)


def _without(body: Manifold, others: list[Manifold]) -> Manifold:
    return Manifold.batch_boolean([body, *others], OpType.Subtract) if others else body


def _with_two_infills(surface: Surface, center: Floats, material: BodyMaterial) -> MovedCenter:
    """Move the center of mass by solid walls, the larger infill inside, and the smaller infill in
    the smallest part beyond a plane: the second file, a modifier for slicers."""
    less, more = material.infill
    room, _ = within_walls(surface, material.wall_mm)
    mass, middle = _weigh(surface, [(room, more - 1.0)])
    files = {"": stl_bytes(surface)}
    if is_shifted(surface, surface.centroid + center - middle):
        cut = beyond_plane(room, center, mass * (middle - center) / (more - less))
        if cut is None:
            raise InputError(
                f"infill: expected two infills that lead {np.linalg.norm(center - middle):.3g} mm "
                f"away, got {less:g} and {more:g}; take others"
            )
        files[MODIFIER] = stl_bytes(mesh_of(solid(surface).trim_by_plane(*cut[1])))
    # From here on by the files.
    surface = read_stl(files[""]).surface
    room, wall = within_walls(surface, material.wall_mm)
    densities = [(room, more - 1.0)]
    notes = [
        f"print it with walls, floor and ceiling of {material.wall_mm:g} mm and "
        f"{100.0 * more:g} % infill"
    ]
    if MODIFIER in files:
        sparse = room ^ solid(read_stl(files[MODIFIER]).surface)
        densities.append((sparse, less - more))
        notes.append(
            f"the part in NAME{MODIFIER} is no body but the place of {100.0 * less:g} % infill: a "
            "modifier in the slicer"
        )
    mass, center = _weigh(surface, densities)
    facts = {"infill": [less, more], "part": mass / surface.volume}
    return MovedCenter(files, center, wall, facts, tuple(notes))


def _weigh(surface: Surface, densities: list[tuple[Manifold, float]]) -> tuple[float, Floats]:
    """Mass and center of mass (3,) of a solid of density 1 with densities added in some parts."""
    mass, moment = surface.volume, surface.volume * surface.centroid
    for part, density in densities:
        volume, centroid = weigh_part(part)
        mass, moment = mass + density * volume, moment + density * volume * centroid
    return mass, moment / mass
