"""The object that is made of a plain convex shape: edges rounded, labels cut in that go along with
their facets, and a hidden hollow that balances them.

Lengths are in millimetres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
from manifold3d import Manifold

from dicedesign.errors import EngravingError
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions
from dicedesign.fabricate.label_layout import Placement
from dicedesign.fabricate.rounded_edges import rounded
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.hulls.polygons import centroid
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.sphere import rotation_between
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface, joined, solid_properties
from dicedesign.optimize.solvers.reshaping import Measured
from dicedesign.rest.outcomes import outcome_odds
from dicedesign.rest.poses import analyse, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.simulation import DieOnTable
from dicedesign.throws.tables import Table


@dataclass(frozen=True)
class ConvexObject:
    """How an object is made of its core, the shape inside the rounded edges.

    Attributes
    ----------
    labels: how they are cut, or None for no labels. edges: how they are rounded, or None for sharp
        ones.
    offset: (3,) from the centroid of the core to a center of mass that was given; None where it is
        that of the solid.
    """

    labels: EngravingOptions | None
    edges: EdgeOptions | None
    offset: Floats | None = None

    def unlabelled(self, core: ConvexHull) -> Surface:
        """The solid without labels."""
        hull = core
        if self.edges is not None:
            center = core.centroid if self.offset is None else core.centroid + self.offset
            hull = rounded(core, center, self.edges)
        return Surface(hull.vertices, hull.triangles)

    def balanced(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The solid by which the object is judged: engraved, with a hidden hollow where that is to
        balance it; whole where the labels are filled. Raises EngravingError."""
        plain = self.unlabelled(core)
        if self.labels is None or not placements or self.labels.balance == "fill":
            return plain
        return self._engraved(plain, placements)

    def engraved(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The solid with its labels cut in, whatever fills them. Raises EngravingError."""
        return self._engraved(self.unlabelled(core), placements)

    def _engraved(self, plain: Surface, placements: Sequence[Placement]) -> Surface:
        from dicedesign.fabricate.engraving import engrave

        if self.labels is None:
            return plain
        marked = engrave(plain.points, plain.triangles, self.placed(placements), self.labels)
        if self.labels.balance != "opposite":
            return marked
        return hollowed(marked, plain.centroid)

    def inlay(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The bodies that fill the labels."""
        from dicedesign.fabricate.engraving import inlay

        assert self.labels is not None
        plain = self.unlabelled(core)
        return inlay(plain.points, plain.triangles, self.placed(placements), self.labels)

    @staticmethod
    def carried(
        placements: Sequence[Placement],
        before: ConvexHull,
        after: ConvexHull,
        moved_normals: Floats,
    ) -> tuple[Placement, ...]:
        """Labels on the facets of one hull, moved onto those of another that is nearly the same.

        A label keeps its size and its place from the centroid of its facet, and turns no more than
        the facet does: so a small change of the shape is a small change of what the labels take
        away.

        moved_normals: (m, 3) unit normals that the facets of the first hull have in the second one.
            The nearest of the second hull's may be another facet's, where two lie almost in one
            plane.
        """
        return tuple(_moved(placement, before, after, moved_normals) for placement in placements)

    @staticmethod
    def bearing(placements: Sequence[Placement]) -> Floats:
        """(l, 3) normals of the facets with labels."""
        return np.array([placement.frame[:3, 2] for placement in placements]).reshape(-1, 3)

    def placed(self, placements: Sequence[Placement]) -> tuple[Placement, ...]:
        """Labels on the facets of the core moved outward onto those of the object."""
        if self.edges is None:
            return tuple(placements)
        lift = self.edges.radius_mm
        frames = [placement.frame.copy() for placement in placements]
        for frame in frames:
            frame[:3, 3] += lift * frame[:3, 2]
        return tuple(
            replace(placement, frame=frame)
            for placement, frame in zip(placements, frames, strict=True)
        )


def measure_resting(
    prior: Prior | None, offset: Floats | None = None
) -> Callable[[Surface, Floats], Measured]:
    """Odds without momentum, under a prior if there is one, of a solid whose outcomes have
    directions (k, 3).

    offset: (3,) of a center of mass that was given, from the centroid of the hull; None for that of
        the solid.
    """

    def measure(surface: Surface, directions: Floats) -> Measured:
        if offset is None:
            poses = rest_poses(make_body(surface.points, surface.triangles))
        else:
            hull = convex_hull(surface.points)
            poses = analyse(hull, hull.centroid + offset)
        odds = outcome_odds(poses.under(prior), directions).odds
        return Measured(poses.center_of_mass, odds)

    return measure


def measure_thrown(
    table: Table, model: MomentumModel | None
) -> Callable[[Surface, Floats], Measured]:
    """The same with odds by the momentum model of a table, which knows the solid's inertia."""

    def measure(surface: Surface, directions: Floats) -> Measured:
        body = make_body(surface.points, surface.triangles)
        die = DieOnTable.of(body, None, directions, table)
        return Measured(np.asarray(die.poses.center_of_mass), die.momentum(model))

    return measure


def _moved(
    placement: Placement, before: ConvexHull, after: ConvexHull, moved_normals: Floats
) -> Placement:
    frame = placement.frame.copy()
    old = int(np.argmax(before.normals @ frame[:3, 2]))
    new = int(np.argmax(after.normals @ moved_normals[old]))
    turn = rotation_between(before.normals[old], after.normals[new])
    from_centroid = frame[:3, 3] - _facet_centroid(before, old, frame)
    frame[:3, :3] = turn @ frame[:3, :3]
    frame[:3, 3] = _facet_centroid(after, new, frame) + turn @ from_centroid
    return replace(placement, frame=frame)


def _facet_centroid(hull: ConvexHull, facet: int, frame: Floats) -> Floats:
    """(3,) of the area of a facet, parallel to the plane of x and y of a frame (4, 4)."""
    corners = hull.polygon(facet)
    origin = corners.mean(axis=0)
    flat = centroid((corners - origin) @ frame[:3, :2])
    middle: Floats = origin + frame[:3, :2] @ flat
    return middle


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
