"""Cavities of a die that keeps the shape of a surface: made, and measured in its file."""

from __future__ import annotations

import numpy as np

from dicedesign.concave.hollow.cavity import balancing_cavity, least_wall
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.orientation import shells_of
from dicedesign.geometry.surfaces.surface import Surface, joined, surface_of
from dicedesign.results.parts import Cavities
from dicedesign.runtime.arrays import Floats

__all__ = ["measured_cavities", "with_cavity"]


def with_cavity(surface: Surface, wall: float, center: Floats) -> Surface:
    """A solid with the least cavity that brings its center of mass to a place (3,), as the surfaces
    of both together. Parameters, and what is raised, as `balancing_cavity`."""
    return joined(surface, _reversed(balancing_cavity(surface, wall, center).surface))


def measured_cavities(body: Body) -> Cavities:
    """The cavities of a body in mm.

    body: of one surface oriented outward and others, oriented inward, inside of it. Raises
    InputError if it is none.
    """
    assert body.triangles is not None
    shell = shells_of(body.triangles)
    shells = [
        surface_of(body.points, body.triangles[shell == k]) for k in range(int(shell.max()) + 1)
    ]
    outer = [each for each in shells if each.volume > 0.0]
    inner = [_reversed(each) for each in shells if each.volume < 0.0]
    if len(outer) != 1 or not inner:
        raise InputError(
            f"{body.name}: expected one surface with cavities inside, got {len(outer)} oriented "
            f"outward and {len(inner)} inward; make the die again"
        )
    whole = Surface(body.points, body.triangles)
    volume = sum(each.volume for each in inner)
    return Cavities(
        number=len(inner),
        wall_mm=min(least_wall(outer[0], each) for each in inner),
        volume_mm3=volume,
        part=volume / outer[0].volume,
        shift_mm=float(np.linalg.norm(whole.centroid - outer[0].centroid)),
    )


def _reversed(surface: Surface) -> Surface:
    return Surface(surface.points, surface.triangles[:, ::-1])
