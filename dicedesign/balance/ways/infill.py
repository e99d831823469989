"""The center of mass moved by two densities of infill, on either side of a plane."""

from __future__ import annotations

from typing import Final

import numpy as np
from manifold3d import Manifold

from dicedesign.balance.ways.material import Material
from dicedesign.balance.ways.way import Made, Way, reach_inside, read_back, stl_file
from dicedesign.concave.hollow.cavity import beyond_plane, within_walls
from dicedesign.concave.result import is_shifted
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.manifold import mesh_of, solid
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.formats import stl_bytes
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.runtime.arrays import Floats

__all__ = ["INFILL"]

MODIFIER: Final = "_sparse.stl"
"""What follows the name in that of the part with less infill."""


def infill_reach(surface: Surface, material: Material) -> ConvexHull:
    """See `Way`."""
    return reach_inside(surface, material, material.infill)


def with_two_infills(surface: Surface, center: Floats, material: Material) -> Made:
    """See `Way`. Walls are solid, and what is deeper than they are thick has the greater infill but
    for the least part, beyond a plane, that has the lesser: the second file, for a slicer to take
    as the place of other settings (a modifier)."""
    less, more = material.infill
    room, _ = within_walls(surface, material.wall_mm)
    mass, middle = _weighed(surface, [(room, more - 1.0)])
    data, body = stl_file(surface.points, surface.triangles)
    files = {"": data}
    if is_shifted(surface, surface.centroid + center - middle):
        cut = beyond_plane(room, center, mass * (middle - center) / (more - less))
        if cut is None:
            raise InputError(
                f"infill: expected two infills that lead {np.linalg.norm(center - middle):.3g} mm "
                f"away, got {less:g} and {more:g}; take others, or by weights"
            )
        part = solid(surface.points, surface.triangles).trim_by_plane(tuple(cut.normal), cut.offset)
        files[MODIFIER] = stl_bytes(*mesh_of(part))
    return _judged(files, body, material)


def _judged(files: dict[str, bytes], body: Body, material: Material) -> Made:
    """By the files."""
    assert body.triangles is not None
    less, more = material.infill
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
    mass, center = _weighed(surface, densities)
    facts = {"infill": [less, more], "part": mass / surface.volume}
    return Made(files, body, center, wall, facts, tuple(notes), modifier)


def _weighed(surface: Surface, densities: list[tuple[Manifold, float]]) -> tuple[float, Floats]:
    """Mass, and center of mass (3,), of a solid of density 1 with others of some added."""
    mass, moment = surface.volume, surface.volume * surface.centroid
    for part, density in densities:
        if part.is_empty():
            continue
        volume, middle = solid_properties(*mesh_of(part))
        mass, moment = mass + density * volume, moment + density * volume * middle
    return mass, moment / mass


INFILL: Final = Way(
    name="infill",
    line="two infills, one of them in a part that is a second file",
    reach=infill_reach,
    make=with_two_infills,
)
