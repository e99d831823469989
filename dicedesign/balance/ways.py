"""Ways to put a center of mass where it is wanted: cavities, drained by holes, and infill.

Lengths are in millimeters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from manifold3d import Manifold, OpType
from scipy.stats import qmc

from dicedesign.balance.cavity import (
    beyond_plane,
    least_wall,
    measure_cavities,
    reach,
    with_cavity,
    within_walls,
)
from dicedesign.balance.goals import rests_at
from dicedesign.balance.options import BodyMaterial
from dicedesign.balance.regions import is_shifted
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.body import Body, make_body, shells_of
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.meshes.reading import parse_stl, stl_bytes
from dicedesign.geometry.sphere import norms, rotation_between, unit_vectors
from dicedesign.geometry.surfaces.grid_surface import closest_points
from dicedesign.geometry.triangles import Surface, doubled_area_vectors, solid_properties
from dicedesign.runtime.arrays import Floats

PLACES: Final = 3000
"""On the surface, of which one is the mouth."""

TRIED: Final = 40
"""The best of them."""

STEEP: Final = 0.85
"""Least cosine of the angle between a hole and the normal at its mouth."""

BEYOND: Final = 0.9
"""Radii that a hole is cut beyond its mouth, and half as many into the cavity."""

APART: Final = 1.3
"""Radii that the axis keeps from the corners of the hull."""

SEGMENTS: Final = 48
"""Of a hole's circle."""


@dataclass(frozen=True, eq=False)
class Hole:
    """A round hole of a radius, from the `mouth` (3,) on the surface along `inward` (3,), a unit
    vector, to a cavity at a distance, the `length`."""

    mouth: Floats
    inward: Floats
    length: float
    radius: float

    def tube(self, factor: float = 1.0) -> Manifold:
        """Hole to cut out, or a wider one that leaves no sliver."""
        radius = factor * self.radius
        before, after = BEYOND * radius, 0.5 * BEYOND * radius
        tube = Manifold.cylinder(before + self.length + after, radius, radius, SEGMENTS)
        frame = np.empty((3, 4))
        frame[:, :3] = rotation_between(np.array([0.0, 0.0, 1.0]), self.inward)
        frame[:, 3] = self.mouth - before * self.inward
        return tube.transform(frame)

    def data(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "mouth": self.mouth.tolist(),
            "inward": self.inward.tolist(),
            "length_mm": self.length,
            "diameter_mm": 2.0 * self.radius,
        }


def drain_hole(surface: Surface, cavity: Surface, center: Floats, radius: float) -> Hole:
    """The shortest hole from the outside to a cavity that keeps clear of the corners of the hull,
    and of the facets that the body rests on if there are others.

    surface: of the body; center: (3,) of mass that it will have. Raises InputError where none does.
    """
    # Points spread over the surface, and the normals there.
    vectors = doubled_area_vectors(surface.points, surface.triangles)
    areas = norms(vectors)
    cumulated = np.cumsum(areas) / areas.sum()
    number = (np.arange(PLACES) + 0.5) / PLACES
    which = np.searchsorted(cumulated, number).clip(max=len(areas) - 1)
    steps = np.sort(qmc.Halton(2, scramble=False).random(PLACES), axis=1)
    weights = np.diff(steps, axis=1, prepend=0.0, append=1.0)
    corners = surface.points[surface.triangles[which]]
    places = (weights[:, :, None] * corners).sum(axis=1)
    normals = vectors[which] / areas[which, None]
    triangles, weights = closest_points(cavity, places)
    feet = (weights[:, :, None] * cavity.points[cavity.triangles[triangles]]).sum(axis=1)
    inward, lengths = unit_vectors(feet - places), norms(feet - places)
    hull = convex_hull(surface.points, single_precision=True)
    apart = norms(places[:, None] - hull.vertices[None]).min(axis=1)
    fits = ((inward * normals).sum(axis=1) <= -STEEP) & (apart > APART * radius)
    # Holes that open toward what the body rests on come last.
    rests = rests_at(hull, center)
    facets = np.zeros(0, dtype=np.int64) if rests is None else rests.facets
    is_stood_on = (hull.depths(places)[:, facets] < 0.1 * radius).any(axis=1)
    order = np.lexsort((lengths, is_stood_on))
    body = solid(surface.points, surface.triangles)
    whole = body.hull().volume()
    for place in order[fits[order]][:TRIED]:
        hole = Hole(places[place], inward[place], float(lengths[place]), radius)
        left = body - hole.tube()
        if abs(left.hull().volume() - whole) <= 1e-9 * whole and len(left.decompose()) == 1:
            return hole
    raise InputError(
        f"drain_mm: expected room for a hole of {2.0 * radius:g} mm that leaves the corners the "
        "body stands on, got none; reduce drain_mm"
    )


SAFE: Final = 0.95
"""Part of a reach that is relied on."""

MOST_HOLES: Final = 6

LEAST_PIECE: Final = 1e-3
"""Volume over that of the largest below which a piece of a difference of files is rounding."""

MODIFIER: Final = "_sparse.stl"
"""What follows the name in that of the part with less infill."""


@dataclass(frozen=True, eq=False)
class Made:
    """A body with its center of mass elsewhere, as files that were read back.

    Attributes
    ----------
    files: contents by what follows the name of the first, such as "_sparse.stl"; that of the body
        is "".
    body: as it was read back.
    center: (3,) of mass, of the files read back with their densities.
    wall_mm: least thickness of the walls, measured in them; None where nothing is inside.
    facts: plain data about what was made; notes: the same for people, a sentence each.
    sparse: the part of less infill, as it was read back, where there is one.
    """

    files: Mapping[str, bytes]
    body: Body
    center: Floats
    wall_mm: float | None
    facts: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    sparse: Body | None = None


def read_back(data: bytes) -> Body:
    """The body of an STL file."""
    points, triangles = parse_stl(data, Path("body.stl"))
    return make_body(points, triangles, "body.stl", single_precision=True)


def reachable_shifts(surface: Surface, by: str, material: BodyMaterial) -> ConvexHull:
    """Shifts of the center of mass from that of the uniform solid of a surface that a way does,
    nearly; see `reach`. Raises InputError where walls leave no room."""
    densities = material.infill if by == "infill" else (0.0, 1.0)
    try:
        return reach(surface, material.wall_mm, SAFE, densities)
    except InputError as error:
        raise InputError(
            f"wall_mm: expected walls that leave room inside, got {material.wall_mm:g} mm in a "
            f"body of {' x '.join(f'{x:.3g}' for x in np.ptp(surface.points, axis=0))} mm; reduce "
            "wall_mm, or enlarge the body with size_mm"
        ) from error


def move_center(surface: Surface, center: Floats, by: str, material: BodyMaterial) -> Made:
    """The solid of a surface, whose coordinates are float32, with its center of mass at (3,): by
    the least "cavity", or by two densities of "infill". Raises InputError where there is no room.
    """
    if by == "infill":
        return _with_two_infills(surface, center, material)
    if not is_shifted(surface, center):
        data = stl_bytes(surface.points, surface.triangles)
        return Made(
            {"": data}, read_back(data), surface.centroid, None, {}, ("nothing is to be moved",)
        )
    if material.drain_mm is not None:
        return _drain(surface, center, material.wall_mm, 0.5 * material.drain_mm)
    whole = with_cavity(surface, material.wall_mm, center)
    data = stl_bytes(whole.points, whole.triangles)
    cavities = measure_cavities(read_back(data))
    return _make_with_cavity(
        data, cavities.wall_mm, cavities.number, cavities.volume_mm3, cavities.part
    )


def _make_with_cavity(
    data: bytes,
    wall: float,
    number: int,
    volume: float,
    part: float,
    holes: tuple[Hole, ...] = (),
) -> Made:
    body = read_back(data)
    assert body.triangles is not None
    facts: dict[str, Any] = {"cavities": number, "cavity_mm3": volume, "part": part}
    several = f"{number} cavities" if number > 1 else "a cavity"
    notes = [f"{several} of {volume:.4g} mm3, {100.0 * part:.3g} % of the body"]
    if holes:
        facts["drains"] = [hole.data() for hole in holes]
        for hole in holes:
            place = ", ".join(f"{x:.4g}" for x in hole.mouth)
            notes.append(f"a hole of {2.0 * hole.radius:g} mm at {place} drains it")
    else:
        notes.append(
            "the cavity is closed: filament leaves it empty, but powder and resin would stay in it"
        )
    center = solid_properties(body.points, body.triangles)[1]
    return Made({"": data}, body, center, wall, facts, tuple(notes))


def _drain(surface: Surface, center: Floats, wall: float, radius: float) -> Made:
    """Drill a hole to each part of the cavity; the cavity is computed again with each hole."""
    body = solid(surface.points, surface.triangles)
    room, _ = within_walls(surface, wall)
    holes: tuple[Hole, ...] = ()
    for _ in range(MOST_HOLES):
        tubes = [hole.tube() for hole in holes]
        rest, free = _without(body, tubes), _without(room, tubes)
        volume, middle = solid_properties(*mesh_of(rest))
        cut = beyond_plane(free, center, volume * (middle - center))
        if cut is None:
            raise InputError(
                f"drain_mm: expected a hole of {2.0 * radius:g} mm that leaves a cavity, got none "
                "with its center of mass where it is wanted; reduce drain_mm or wall_mm"
            )
        closed = [
            part
            for part in cut.part.decompose()
            if not any(tube.min_gap(part, radius) < 1e-6 * radius for tube in tubes)
        ]
        if not closed:
            # All that is beyond the plane, as what lies within the holes is gone already.
            cavity = rest - room.trim_by_plane(tuple(cut.normal), cut.offset)
            break
        holes += (drain_hole(surface, Surface(*mesh_of(closed[0])), center, radius),)
    else:
        raise InputError(
            f"drain_mm: expected a cavity of at most {MOST_HOLES} parts to drain, got more; leave "
            "drain_mm out, or reduce wall_mm"
        )
    data = stl_bytes(*mesh_of(cavity))
    file = read_back(data)
    assert file.triangles is not None
    shells = int(shells_of(file.triangles).max()) + 1
    if shells > 1:
        raise InputError(
            f"drain_mm: expected a body of one surface, got {shells} with the holes; reduce "
            "drain_mm"
        )
    # What is missing in the file, but for the holes.
    missing = body - solid(file.points, file.triangles)
    pieces = _without(missing, [hole.tube(1.05) for hole in holes]).decompose()
    largest = max(piece.volume() for piece in pieces)
    parts = [piece for piece in pieces if piece.volume() > LEAST_PIECE * largest]
    least = min(least_wall(surface, Surface(*mesh_of(part))) for part in parts)
    if least < 0.9 * wall:
        raise InputError(
            f"drain_mm: expected walls of {wall:g} beside the holes, got {least:.3g}; reduce "
            "drain_mm"
        )
    volume = float(missing.volume())
    return _make_with_cavity(data, least, len(parts), volume, volume / surface.volume, holes)


def _without(body: Manifold, others: list[Manifold]) -> Manifold:
    return Manifold.batch_boolean([body, *others], OpType.Subtract) if others else body


def _with_two_infills(surface: Surface, center: Floats, material: BodyMaterial) -> Made:
    """Walls are solid, and what is deeper than they are thick has the greater infill but
    for the least part, beyond a plane, that has the lesser: the second file, for a slicer to take
    as the place of other settings (a modifier)."""
    less, more = material.infill
    room, _ = within_walls(surface, material.wall_mm)
    mass, middle = _weigh(surface, [(room, more - 1.0)])
    files = {"": stl_bytes(surface.points, surface.triangles)}
    if is_shifted(surface, surface.centroid + center - middle):
        cut = beyond_plane(room, center, mass * (middle - center) / (more - less))
        if cut is None:
            raise InputError(
                f"infill: expected two infills that lead {np.linalg.norm(center - middle):.3g} mm "
                f"away, got {less:g} and {more:g}; take others"
            )
        part = solid(surface.points, surface.triangles).trim_by_plane(tuple(cut.normal), cut.offset)
        files[MODIFIER] = stl_bytes(*mesh_of(part))
    # Judged by the files.
    body = read_back(files[""])
    assert body.triangles is not None
    surface = Surface(body.points, body.triangles)
    room, wall = within_walls(surface, material.wall_mm)
    densities = [(room, more - 1.0)]
    notes = [
        f"print it with walls, floor and ceiling of {material.wall_mm:g} mm and "
        f"{100.0 * more:g} % infill"
    ]
    modifier = None
    if MODIFIER in files:
        modifier = read_back(files[MODIFIER])
        assert modifier.triangles is not None
        sparse = room ^ solid(modifier.points, modifier.triangles)
        densities.append((sparse, less - more))
        notes.append(
            f"the part in NAME{MODIFIER} is no body but the place of {100.0 * less:g} % infill: a "
            "modifier in the slicer"
        )
    mass, center = _weigh(surface, densities)
    facts = {"infill": [less, more], "part": mass / surface.volume}
    return Made(files, body, center, wall, facts, tuple(notes), modifier)


def _weigh(surface: Surface, densities: list[tuple[Manifold, float]]) -> tuple[float, Floats]:
    """Mass, and center of mass (3,), of a solid of density 1 with others of some added."""
    mass, moment = surface.volume, surface.volume * surface.centroid
    for part, density in densities:
        if part.is_empty():
            continue
        volume, middle = solid_properties(*mesh_of(part))
        mass, moment = mass + density * volume, moment + density * volume * middle
    return mass, moment / mass
