"""The center of mass moved by the least cavity, closed or drained."""

from __future__ import annotations

from typing import Any, Final

from manifold3d import Manifold, OpType

from dicedesign.balance.ways.drain import Hole, drain_hole
from dicedesign.balance.ways.material import Material
from dicedesign.balance.ways.way import Made, Way, reach_inside, stl_file
from dicedesign.concave.hollow.cavity import beyond_plane, least_wall, within_walls
from dicedesign.concave.result import is_shifted
from dicedesign.errors import InputError
from dicedesign.fabricate.solids.hollow import measured_cavities, with_cavity
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.manifold import mesh_of, solid
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.orientation import shells_of
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["CAVITY"]

MOST_HOLES: Final = 6

LEAST_PIECE: Final = 1e-3
"""Volume over that of the largest below which a piece of a difference of files is rounding."""


def cavity_reach(surface: Surface, material: Material) -> ConvexHull:
    """See `Way`."""
    return reach_inside(surface, material)


def with_least_cavity(surface: Surface, center: Floats, material: Material) -> Made:
    """See `Way`."""
    if not is_shifted(surface, center):
        data, body = stl_file(surface.points, surface.triangles)
        return Made({"": data}, body, surface.centroid, None, {}, ("nothing is to be moved",))
    if material.drain_mm is not None:
        return _drained(surface, center, material.wall_mm, 0.5 * material.drain_mm)
    whole = with_cavity(surface, material.wall_mm, center)
    data, body = stl_file(whole.points, whole.triangles)
    found = measured_cavities(body)
    return _made(data, body, found.wall_mm, found.number, found.volume_mm3, found.part, ())


def _made(
    data: bytes,
    body: Body,
    wall: float,
    number: int,
    volume: float,
    part: float,
    holes: tuple[Hole, ...],
) -> Made:
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


def _drained(surface: Surface, center: Floats, wall: float, radius: float) -> Made:
    """With a hole to each part of the cavity, which is found again with each hole."""
    body = solid(surface.points, surface.triangles)
    room, _ = within_walls(surface, wall)
    holes: tuple[Hole, ...] = ()
    for _ in range(MOST_HOLES):
        rest = _without(body, [hole.solid for hole in holes])
        free = _without(room, [hole.solid for hole in holes])
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
            if not any(hole.solid.min_gap(part, radius) < 1e-6 * radius for hole in holes)
        ]
        if not closed:
            # All that is beyond the plane, as what lies within the holes is gone already.
            inner = room.trim_by_plane(tuple(cut.normal), cut.offset)
            return _drained_file(surface, rest - inner, holes, wall)
        holes += (drain_hole(surface, Surface(*mesh_of(closed[0])), center, radius),)
    raise InputError(
        f"drain_mm: expected a cavity of at most {MOST_HOLES} parts to drain, got more; leave "
        "drain_mm out, or reduce wall_mm"
    )


def _drained_file(surface: Surface, made: Manifold, holes: tuple[Hole, ...], wall: float) -> Made:
    data, body = stl_file(*mesh_of(made))
    assert body.triangles is not None
    shells = int(shells_of(body.triangles).max()) + 1
    if shells > 1:
        raise InputError(
            f"drain_mm: expected a body of one surface, got {shells} with the holes; reduce "
            "drain_mm"
        )
    # What is missing in the file, but for the holes.
    missing = solid(surface.points, surface.triangles) - solid(body.points, body.triangles)
    pieces = _without(missing, [hole.wider for hole in holes]).decompose()
    largest = max(piece.volume() for piece in pieces)
    parts = [piece for piece in pieces if piece.volume() > LEAST_PIECE * largest]
    least = min(least_wall(surface, Surface(*mesh_of(part))) for part in parts)
    if least < 0.9 * wall:
        raise InputError(
            f"drain_mm: expected walls of {wall:g} beside the holes, got {least:.3g}; reduce "
            "drain_mm"
        )
    volume = float(missing.volume())
    part = volume / surface.volume
    return _made(data, body, least, len(parts), volume, part, holes)


def _without(body: Manifold, others: list[Manifold]) -> Manifold:
    return Manifold.batch_boolean([body, *others], OpType.Subtract) if others else body


CAVITY: Final = Way(
    name="cavity",
    line="the least cavity within walls",
    reach=cavity_reach,
    make=with_least_cavity,
)
