"""A hole that drains a cavity, where it changes nothing that a body stands on.

Lengths are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from manifold3d import Manifold
from scipy.stats import qmc

from dicedesign.balance.goals import rests_at
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.manifold import solid
from dicedesign.geometry.sphere import norms, rotation_between, unit_vectors
from dicedesign.geometry.surfaces.distances import closest_points
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import doubled_area_vectors
from dicedesign.runtime.arrays import Booleans, Floats

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

    @cached_property
    def solid(self) -> Manifold:
        """What is cut out."""
        return self._cylinder(self.radius)

    @cached_property
    def wider(self) -> Manifold:
        """The same a little wider and longer, so that nothing of it is left."""
        return self._cylinder(1.05 * self.radius)

    def _cylinder(self, radius: float) -> Manifold:
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
    places, normals = _spread(surface)
    triangles, weights = closest_points(cavity, places)
    feet = (weights[:, :, None] * cavity.points[cavity.triangles[triangles]]).sum(axis=1)
    inward, lengths = unit_vectors(feet - places), norms(feet - places)
    hull = convex_hull(surface.points, single_precision=True)
    corners = norms(places[:, None] - hull.vertices[None]).min(axis=1)
    fits = ((inward * normals).sum(axis=1) <= -STEEP) & (corners > APART * radius)
    order = np.lexsort((lengths, _is_stood_on(hull, center, places, radius)))
    body = solid(surface.points, surface.triangles)
    whole = body.hull().volume()
    for place in order[fits[order]][:TRIED]:
        hole = Hole(places[place], inward[place], float(lengths[place]), radius)
        left = body - hole.solid
        if abs(left.hull().volume() - whole) <= 1e-9 * whole and len(left.decompose()) == 1:
            return hole
    raise InputError(
        f"drain_mm: expected room for a hole of {2.0 * radius:g} mm that leaves the corners the "
        "body stands on, got none; reduce drain_mm"
    )


def _spread(surface: Surface) -> tuple[Floats, Floats]:
    """Points (p, 3) spread over a surface, and the normals there."""
    vectors = doubled_area_vectors(surface.points, surface.triangles)
    areas = norms(vectors)
    cumulated = np.cumsum(areas) / areas.sum()
    number = (np.arange(PLACES) + 0.5) / PLACES
    which = np.searchsorted(cumulated, number).clip(max=len(areas) - 1)
    steps = np.sort(qmc.Halton(2, scramble=False).random(PLACES), axis=1)
    weights = np.diff(steps, axis=1, prepend=0.0, append=1.0)
    corners = surface.points[surface.triangles[which]]
    return (weights[:, :, None] * corners).sum(axis=1), vectors[which] / areas[which, None]


def _is_stood_on(hull: ConvexHull, center: Floats, places: Floats, radius: float) -> Booleans:
    """Whether a hole at places (p, 3) opens towards what the body rests on."""
    rests = rests_at(hull, center)
    if rests is None:
        return np.zeros(len(places), dtype=bool)
    depths = hull.depths(places)[:, rests.facets]
    return np.asarray((depths < 0.1 * radius).any(axis=1))
