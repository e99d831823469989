"""The object that is made of a plain convex shape: edges rounded or chamfered, labels cut in that
go along with their facets, and a hidden hollow that balances them.

A ball is rolled over a core: the rounded solid is the hull of points at the radius from the core's
corners. Height over the table is then that of the core plus the radius, so that a perfectly round
solid has the probabilities of its core. Lengths are in millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from manifold3d import Manifold
from scipy.spatial import cKDTree

from dicedesign.errors import EngravingError
from dicedesign.fabricate.engraving import engrave, inlay
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.fabricate.label_layout import Placement
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.hulls.polygons import centroid, facet_inradius
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.sphere import foot_on_line, norms, rotation_between, unit_vectors
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface, join_surfaces, solid_properties
from dicedesign.optimize.solvers.reshaping import Measured
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import MomentumModel
from dicedesign.throws.simulation import DieOnTable
from dicedesign.throws.tables import Table


@dataclass(frozen=True)
class ConvexObject:
    """Recipe of an object from its core, the shape inside the rounded edges.

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

    def make_unlabeled(self, core: ConvexHull) -> Surface:
        """The solid without labels."""
        hull = core
        if self.edges is not None:
            center = core.centroid if self.offset is None else core.centroid + self.offset
            hull = round_edges(core, center, self.edges)
        return Surface(hull.vertices, hull.triangles)

    def make_balanced(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The solid by which the object is judged: engraved, with a hidden hollow where that is to
        balance it; whole where the labels are filled. Raises EngravingError."""
        if self.labels is None or self.labels.balance == "fill":
            return self.make_unlabeled(core)
        return self.make_engraved(core, placements)

    def make_engraved(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """Solid with its labels cut in, without fillings. Raises EngravingError."""
        plain = self.make_unlabeled(core)
        if self.labels is None or not placements:
            return plain
        marked = engrave(plain.points, plain.triangles, self.place_labels(placements), self.labels)
        return hollow_out(marked, plain.centroid) if self.labels.balance == "opposite" else marked

    def inlay(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """The bodies that fill the labels."""
        assert self.labels is not None
        plain = self.make_unlabeled(core)
        return inlay(plain.points, plain.triangles, self.place_labels(placements), self.labels)

    @staticmethod
    def carry_labels(
        placements: Sequence[Placement],
        before: ConvexHull,
        after: ConvexHull,
        moved_normals: Floats,
    ) -> tuple[Placement, ...]:
        """Move labels from the facets of one hull onto those of a nearly equal one.

        A label keeps its size and its place from the centroid of its facet, and turns no more than
        the facet does: so a small change of the shape is a small change of what the labels take
        away.

        moved_normals: (m, 3) unit normals that the facets of the first hull have in the second one.
            The nearest of the second hull's may be another facet's, where two lie almost in one
            plane.
        """

        def middle(hull: ConvexHull, facet: int, frame: Floats) -> Floats:
            corners = hull.polygon(facet)
            origin = corners.mean(axis=0)
            return np.asarray(origin + frame[:3, :2] @ centroid((corners - origin) @ frame[:3, :2]))

        moved = []
        for placement in placements:
            frame = placement.frame.copy()
            old = int(np.argmax(before.normals @ frame[:3, 2]))
            new = int(np.argmax(after.normals @ moved_normals[old]))
            turn = rotation_between(before.normals[old], after.normals[new])
            from_middle = frame[:3, 3] - middle(before, old, frame)
            frame[:3, :3] = turn @ frame[:3, :3]
            frame[:3, 3] = middle(after, new, frame) + turn @ from_middle
            moved.append(replace(placement, frame=frame))
        return tuple(moved)

    @staticmethod
    def bearing(placements: Sequence[Placement]) -> Floats:
        """(l, 3) normals of the facets with labels."""
        return np.array([placement.frame[:3, 2] for placement in placements]).reshape(-1, 3)

    def place_labels(self, placements: Sequence[Placement]) -> tuple[Placement, ...]:
        """Move labels from the facets of the core outward onto those of the object."""
        lift = 0.0 if self.edges is None else self.edges.radius_mm
        return tuple(each.shift(lift * each.frame[:3, 2]) for each in placements)


def core_of(poses: RestPoses, edges: EdgeOptions | None) -> ConvexHull:
    """Core of a convex die: the shape inside the rounded edges, with the facet numbers of the die.

    Raises EngravingError where the radius is larger than the circle of a facet to rest on.
    """
    hull = poses.hull
    if edges is None:
        return hull
    core = convex_hull(core_scale(edges, hull.diameter) * hull.vertices)
    for facet in poses.facets.tolist():
        room = facet_inradius(core, facet)
        if edges.radius_mm > room:
            raise EngravingError(
                f"edges.radius_mm: expected at most the radius of the circle that is left flat on "
                f"facet {facet}, {room:.3g} mm, got {edges.radius_mm:g}; lower it, or take a "
                "larger size_mm"
            )
    return core


def measure_resting(
    prior: Prior | None, offset: Floats | None = None
) -> Callable[[Surface, Floats], Measured]:
    """Probabilities without momentum, under a prior if there is one, of a solid whose outcomes have
    directions (k, 3).

    offset: (3,) of a center of mass that was given, from the centroid of the hull; None for that of
        the solid.
    """

    def measure(surface: Surface, directions: Floats) -> Measured:
        if offset is None:
            poses = rest_poses(make_body(surface.points, surface.triangles))
        else:
            hull = convex_hull(surface.points)
            poses = analyze(hull, hull.centroid + offset)
        probabilities = outcome_probabilities(poses.under(prior), directions).probabilities
        return Measured(poses.center_of_mass, probabilities)

    return measure


def measure_thrown(
    table: Table, model: MomentumModel | None
) -> Callable[[Surface, Floats], Measured]:
    """Measure of an object's probabilities by the momentum model of a table, which needs the
    solid's inertia."""

    def measure(surface: Surface, directions: Floats) -> Measured:
        body = make_body(surface.points, surface.triangles)
        die = DieOnTable.of(body, None, directions, table)
        return Measured(np.asarray(die.poses.center_of_mass), die.momentum(model))

    return measure


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


def hollow_out(surface: Surface, center: Floats) -> Surface:
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
    points, triangles = mesh_of(Manifold.sphere(1.0, SEGMENTS))
    unit_volume, middle = solid_properties(points, triangles)
    farthest = min(0.5 * surface.diagonal, size / (unit_volume * LEAST_RADIUS**3))
    distances = farthest * np.arange(PLACES, 0, -1) / PLACES
    radii = np.cbrt(size / (unit_volume * distances))
    middles = center + distances[:, None] * toward
    rooms = distances_from_surface(surface, middles) - WALL - radii
    hull = convex_hull(surface.points)
    fits = (rooms >= 0.0) & (hull.least_depths(middles) >= WALL + radii)
    if not fits.any():
        raise EngravingError(
            f"balance: expected room for a hollow of {size:.3g} mm4 in moment with walls of "
            f"{WALL:g} mm, got none; reduce depth_mm, or take balance: shape"
        )
    best = int(np.argmax(fits))
    ball = middles[best] + radii[best] * (points - middle)
    return join_surfaces(surface, Surface(ball, triangles[:, ::-1]))


TURN: Final = math.radians(11.0)
"""Largest angle between neighboring flat strips of a fillet: no part of the angles of the regular
solids, so that a small change of a shape is a small change of its strips."""

CROWDED: Final = 0.02
"""Least distance between two points, over the radius."""

SAME: Final = 2e-3
"""The same between points that keep the solid from resting where it should not."""


def round_edges(hull: ConvexHull, center: Floats, options: EdgeOptions) -> ConvexHull:
    """The solid that a ball rolled over a core fills, with flat strips in place of round ones.

    A flat strip could be rested on where the ideal round one is passed over: at a saddle, or at the
    top of a corner. So these directions are always edges or corners between strips, and a chamfer
    that has such a direction in its middle is made of two.

    hull: the core. center: (3,) the center of mass. Returns the hull of the solid.
    """
    turn = TURN if options.shape == "fillet" else math.pi
    saddles, arcs = _arcs(hull, center, turn)
    start, outgoing = hull.outgoing
    # Corners of facets, then what must not be rested on, then the rest.
    kinds: tuple[list[Floats], ...] = ([], [], [])
    for vertex, place in enumerate(hull.vertices):
        own = outgoing[start[vertex] : start[vertex + 1]]
        normals = hull.normals[hull.facet[own]]
        # A corner is a top where all its edges lead down.
        edges = hull.vertices[hull.head[own]] - place
        is_top = bool((edges @ (place - center) < 0.0).all())
        middle = unit_vectors(place - center if is_top else normals.sum(axis=0))
        border = [arcs[edge] for edge in own.tolist()]
        tops = middle[None] if is_top else np.empty((0, 3))
        passed = np.concatenate([tops, *(saddles[edge] for edge in own.tolist())])
        for kind, directions in zip(
            kinds, (normals, passed, _inside(middle, border, turn)), strict=True
        ):
            kind.append(place + options.radius_mm * directions)
    corners, passed, others = (np.concatenate(kind) for kind in kinds)
    points = _spread(corners, passed, SAME * options.radius_mm)
    return convex_hull(_spread(points, others, CROWDED * options.radius_mm))


def _spread(points: Floats, others: Floats, least: float) -> Floats:
    """Points (n, 3), and of others (m, 3) those that are farther than a distance from them and from
    each other: slivers between crowded points would be all that a file in single precision tells.
    """
    together = np.concatenate([points, others])
    is_outer = np.ones(len(together), dtype=bool)
    pairs = cKDTree(together).query_pairs(least, output_type="ndarray")
    for one, other in sorted(map(tuple, np.sort(pairs, axis=1).tolist())):
        if is_outer[one] and other >= len(points):
            is_outer[other] = False
    return together[is_outer]


def _arcs(
    hull: ConvexHull, center: Floats, turn: float
) -> tuple[list[Floats], list[tuple[Floats, Integers]]]:
    """For each half-edge directions between the normals of the facets beside it: (0 or 1, 3) that
    of the saddle; and (a, 3) all, the normals included, with their numbers (a,), 0 for the saddle.
    """
    none = np.empty((0, 3))
    saddles = [none] * len(hull.tail)
    arcs = [(none, np.empty(0, dtype=np.int64))] * len(hull.tail)
    radii = hull.vertices - center
    for edge, twin in enumerate(hull.twin.tolist()):
        if edge > twin:
            continue
        ends = hull.normals[[hull.facet[edge], hull.facet[twin]]]
        tail, head = radii[hull.tail[edge]], radii[hull.head[edge]]
        saddle = unit_vectors(foot_on_line(tail, head, head - tail, np))
        directions, first = _along(ends[0], ends[1], turn), 0
        # On their great circle between the two normals, and near to neither: beside a normal
        # nothing can be rested on but the facet.
        is_between = float((ends @ saddle).min()) > float(ends[0] @ ends[1])
        if is_between and float(norms(ends - saddle).min()) > SAME:
            saddles[edge] = saddles[twin] = saddle[None]
            before, after = _along(ends[0], saddle, turn), _along(saddle, ends[1], turn)
            directions, first = np.concatenate([before, after[1:]]), 1 - len(before)
        arcs[edge] = arcs[twin] = directions, np.arange(first, first + len(directions))
    return saddles, arcs


def _along(one: Floats, other: Floats, turn: float) -> Floats:
    """Directions (a, 3) from one to another, at equal angles of at most a turn."""
    angle = math.acos(min(max(float(one @ other), -1.0), 1.0))
    count = max(1, math.ceil(angle / turn))
    if angle < SAME:
        return np.stack([one, other])
    parts = np.linspace(0.0, 1.0, count + 1)[:, None]
    directions = np.sin((1.0 - parts) * angle) * one + np.sin(parts * angle) * other
    return np.asarray(directions / math.sin(angle), dtype=np.float64)


def _inside(middle: Floats, border: Sequence[tuple[Floats, Integers]], turn: float) -> Floats:
    """Directions (a, 3) of strips at a corner: those of the arcs on the border of the cone of its
    normals, and some between these and its middle, about as far apart."""
    directions = [arc for arc, _ in border]
    if turn >= math.pi:
        return np.concatenate(directions)
    directions.append(middle[None])
    for arc, numbers in border:
        for number, direction in zip(numbers.tolist(), arc, strict=True):
            path = _along(middle, direction, turn)
            # Every second, fourth, ... of the paths goes on where they come together, that from
            # the saddle to the end.
            parts = np.arange(1, len(path) - 1) / (len(path) - 1)
            strides = 2.0 ** np.floor(-np.log2(parts))
            directions.append(path[1:-1][number % strides == 0])
    return np.concatenate(directions)
