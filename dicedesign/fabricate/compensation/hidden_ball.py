"""A hidden hollow that brings the center of mass of an engraved solid back to where it was.

Lengths are in millimetres.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from manifold3d import Manifold

from dicedesign.errors import EngravingError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.manifold import mesh_of
from dicedesign.geometry.solid import solid_properties
from dicedesign.geometry.surfaces.distances import distances_from_surface
from dicedesign.geometry.surfaces.surface import Surface, joined
from dicedesign.runtime.arrays import Floats, Integers

__all__ = ["hollowed"]

LEAST_RADIUS: Final = 1.0
"""Of a hollow, in mm: printers lose smaller ones."""

WALL: Final = 1.0
"""Least thickness of the body around the hollow, in mm."""

SEGMENTS: Final = 32
"""Of the hollow's equator."""

PLACES: Final = 64
"""Distances of the hollow from the center that are tried, the farthest, where it is smallest,
first."""

SHIFT: Final = 1e-12
"""Distance of the centers of mass, over the size of the body, up to which there is nothing to
balance."""


def hollowed(surface: Surface, center: Floats) -> Surface:
    """An engraved solid with a hollow ball inside, so that its center of mass is at a point.

    The ball lies on the heavier side, opposite to the labels together, as small as it can be.

    surface: of the solid, convex but for its labels; center: (3,).

    Raises
    ------
    EngravingError: there is no room for it.
    """
    volume = surface.volume
    # A hollow at x of volume v takes v (x - center) away.
    moment = volume * (surface.centroid - center)
    size = float(np.linalg.norm(moment))
    if size <= SHIFT * volume * surface.diagonal:
        return surface
    toward = moment / size
    points, triangles, unit_volume = _unit_ball()
    farthest = min(0.5 * surface.diagonal, size / (unit_volume * LEAST_RADIUS**3))
    distances = farthest * np.arange(PLACES, 0, -1) / PLACES
    radii = np.cbrt(size / (unit_volume * distances))
    middles = center + distances[:, None] * toward
    rooms = distances_from_surface(surface, middles) - WALL - radii
    hull = convex_hull(surface.points)
    fits = (rooms >= 0.0) & (hull.depths(middles).min(axis=1) >= WALL + radii)
    if not fits.any():
        raise EngravingError(
            f"balance: expected room for a hollow of {size:.3g} mm4 in moment with walls of "
            f"{WALL:g} mm, got none; reduce depth_mm, or take balance: shape"
        )
    best = int(np.argmax(fits))
    ball = middles[best] + radii[best] * points
    return joined(surface, Surface(ball, triangles[:, ::-1]))


@cache
def _unit_ball() -> tuple[Floats, Integers, float]:
    """Points, triangles and volume of a ball of radius 1 with its center of mass at the origin."""
    points, triangles = mesh_of(Manifold.sphere(1.0, SEGMENTS))
    volume, center = solid_properties(points, triangles)
    return points - center, triangles, volume
