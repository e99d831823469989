"""Finished object of a plain convex shape: rounded or chamfered edges, labels that move with their
facets, and a hidden hollow that balances them.

A ball is rolled over a core: the rounded solid is the hull of points at the radius from the core's
corners. Its height over the table is the core's plus the radius, so a perfectly round solid has the
probabilities of its core. Lengths are in millimeters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold
from scipy.spatial import cKDTree

from dicedesign.errors import EngravingError
from dicedesign.fabricate.engraving import engrave, inlay
from dicedesign.fabricate.finish_options import EdgeOptions, EngravingOptions, core_scale
from dicedesign.fabricate.label_layout import Placement
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.hulls.polygons import centroid, facet_inradius
from dicedesign.geometry.meshes.body import body_of
from dicedesign.geometry.meshes.manifold import mesh_of
from dicedesign.geometry.sphere import foot_on_line, norms, rotation_between, unit_vectors
from dicedesign.geometry.surfaces.grid_surface import distances_from_surface
from dicedesign.geometry.triangles import Surface, join_surfaces
from dicedesign.optimize.solvers.reshaping import Measured
from dicedesign.rest.outcomes import outcome_probabilities
from dicedesign.rest.poses import RestPoses, analyze, rest_poses
from dicedesign.rest.prior import Prior
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.momentum_model import momentum_model
from dicedesign.throws.simulation import DieOnTable


@dataclass(frozen=True)
class ConvexObject:
    """Maker of a finished object from its core, the shape inside the rounded edges.

    Attributes
    ----------
    labels: options, or None for no labels. edges: options, or None for sharp ones.
    offset: (3,) from the centroid of the core to a given center of mass; None for the solid's.
    """

    labels: EngravingOptions | None
    edges: EdgeOptions | None
    offset: Floats | None = None

    def make_unlabeled(self, core: ConvexHull) -> Surface:
        """Make the solid without labels."""
        if self.edges is None:
            return core.surface
        center = core.centroid if self.offset is None else core.centroid + self.offset
        return round_edges(core, center, self.edges).surface

    def make_balanced(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """Make the solid that has the object's probabilities: engraved, or whole if labels are
        filled. Raises EngravingError."""
        is_filled = self.labels is not None and self.labels.balance == "fill"
        return self.make_engraved(core, () if is_filled else placements)

    def make_engraved(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """Make the solid with its labels cut in, and a hidden hollow to balance them if the options
        say so. Raises EngravingError."""
        plain = self.make_unlabeled(core)
        if self.labels is None or not placements:
            return plain
        marked = engrave(plain, self.place_labels(placements), self.labels)
        return hollow_out(marked, plain.centroid) if self.labels.balance == "opposite" else marked

    def inlay(self, core: ConvexHull, placements: Sequence[Placement]) -> Surface:
        """Make the bodies that fill the labels."""
        assert self.labels is not None
        return inlay(self.make_unlabeled(core), self.place_labels(placements), self.labels)

    @staticmethod
    def carry_labels(
        placements: Sequence[Placement],
        before: ConvexHull,
        after: ConvexHull,
        moved_normals: Floats,
    ) -> tuple[Placement, ...]:
        """Move labels from the facets of one hull onto those of a nearly equal one.

        A label keeps its size and its offset from the centroid of its facet, and turns no more than
        the facet, so a small change of the shape is a small change of the removed material.

        moved_normals: (m, 3) unit normals of the facets of the first hull in the second one. The
            nearest normal may be another facet's if two are almost coplanar.
        """

        def middle(hull: ConvexHull, facet: int, label: Placement) -> Floats:
            corners = hull.polygon(facet)
            origin = corners.mean(axis=0)
            return np.asarray(origin + label.plane @ centroid((corners - origin) @ label.plane))

        moved = []
        for label in placements:
            old = int(np.argmax(before.normals @ label.normal))
            new = int(np.argmax(after.normals @ moved_normals[old]))
            turn = rotation_between(before.normals[old], after.normals[new])
            from_middle = label.origin - middle(before, old, label)
            turned = label.turn(turn)
            moved.append(turned.move_to(middle(after, new, turned) + turn @ from_middle))
        return tuple(moved)

    @staticmethod
    def bearing(placements: Sequence[Placement]) -> Floats:
        """(l, 3) normals of the facets with labels."""
        return np.array([placement.normal for placement in placements]).reshape(-1, 3)

    def place_labels(self, placements: Sequence[Placement]) -> tuple[Placement, ...]:
        """Move labels from the facets of the core outward onto the object."""
        lift = 0.0 if self.edges is None else self.edges.radius_mm
        return tuple(each.shift(lift * each.normal) for each in placements)


def core_of(poses: RestPoses, edges: EdgeOptions | None) -> ConvexHull:
    """Core of a convex die: the shape inside the rounded edges, with the die's facet numbers.

    Raises EngravingError if the radius exceeds the inradius of a facet to rest on.
    """
    hull = poses.hull
    if edges is None:
        return hull
    core = convex_hull(core_scale(edges, hull.diameter) * hull.vertices)
    for facet in poses.facets.tolist():
        room = facet_inradius(core, facet)
        if edges.radius_mm > room:
            raise EngravingError(
                f"edges.radius_mm: expected at most {room:.3g}, the radius of the flat circle on "
                f"facet {facet}, got {edges.radius_mm:g}; lower it, or take a larger size_mm"
            )
    return core


def measure_resting(
    prior: Prior | None, offset: Floats | None = None, outcome_of: Integers | None = None
) -> Callable[[Surface, Floats], Measured]:
    """Measure of a solid's probabilities without momentum, under a prior if any, for directions
    (f, 3) of its faces.

    offset: (3,) from the centroid of the hull to a given center of mass; None for the solid's.
    outcome_of: (f,) outcome that each face shows; None for one outcome each.
    """

    def measure(surface: Surface, directions: Floats) -> Measured:
        if offset is None:
            poses = rest_poses(surface)
        else:
            hull = convex_hull(surface.points)
            poses = analyze(hull, hull.centroid + offset)
        outcomes = outcome_probabilities(poses.under(prior), directions, outcome_of)
        return Measured(poses.center_of_mass, outcomes.probabilities)

    return measure


def measure_thrown(
    table: str, outcome_of: Integers | None = None
) -> Callable[[Surface, Floats], Measured]:
    """Measure of a solid's probabilities by the momentum model of a table, by its name; see
    `measure_resting`."""
    mixture = momentum_model(table)

    def measure(surface: Surface, directions: Floats) -> Measured:
        die = DieOnTable.of(body_of(surface), None, directions, table, outcome_of)
        return Measured(np.asarray(die.poses.center_of_mass), die.momentum(mixture))

    return measure


LEAST_RADIUS = 1.0
"""Least radius of a hollow in mm: printers lose smaller ones."""

WALL = 1.0
"""Least thickness of the body around the hollow, in mm."""

SEGMENTS = 32
"""Number of segments of the hollow's equator."""

PLACES = 64
"""Number of candidate distances of the hollow from the center; at the largest it is smallest."""

SHIFT = 1e-12
"""Largest distance of the centers of mass that needs no balance, over the size of the body."""


def hollow_out(surface: Surface, center: Floats) -> Surface:
    """Hollow a ball inside an engraved solid to move its center of mass to a point.

    The ball is on the heavier side, opposite to the labels together, as small as possible.

    surface: of the solid, convex but for its labels; center: (3,) the point. Raises EngravingError
    if there is no room for the ball.
    """
    volume = surface.volume
    # A hollow of volume v at x has the moment v (x - center).
    moment = volume * (surface.centroid - center)
    size = float(np.linalg.norm(moment))
    if size <= SHIFT * volume * surface.diagonal:
        return surface
    toward = moment / size
    sphere = mesh_of(Manifold.sphere(1.0, SEGMENTS))
    unit_volume, middle = sphere.volume, sphere.centroid
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
    ball = sphere.with_points(middles[best] + radii[best] * (sphere.points - middle))
    return join_surfaces(surface, ball.reverse())


TURN = math.radians(11.0)
"""Largest angle between neighboring flat strips of a fillet, in radians. It divides no angle of the
regular solids, so a small change of a shape is a small change of its strips."""

CROWDED = 0.02
"""Least distance between two points, over the radius."""

SAME = 2e-3
"""Least distance over the radius between points that prevent additional rests."""


def round_edges(hull: ConvexHull, center: Floats, options: EdgeOptions) -> ConvexHull:
    """Round the edges of a core: hull of the volume of a ball rolled over it, with flat strips.

    A flat strip would add a rest where the ideal round one has none: at a saddle, or at the top of
    a corner. So these directions are always edges or corners between strips, and a chamfer with
    such a direction in its middle consists of two.

    hull: the core. center: (3,) the center of mass.
    """
    turn = TURN if options.shape == "fillet" else math.pi
    saddles, arcs = _arcs(hull, center, turn)
    start, outgoing = hull.outgoing
    # Corners of facets, then points at directions that must not become rests, then the others.
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
    """Points (n, 3), and those of the others (m, 3) that are farther than a distance from them and
    from each other: single precision would spoil slivers between crowded points."""
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
    """Directions between the normals of the two facets of each half-edge: (0 or 1, 3) of the
    saddle; and (a, 3) of all strips and the normals, with their numbers (a,), 0 at the saddle."""
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
        # Between the normals on their great circle, and near neither: beside a normal only the
        # facet is a rest.
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
    if angle < SAME:
        return np.stack([one, other])
    parts = np.linspace(0.0, 1.0, math.ceil(angle / turn) + 1)[:, None]
    directions = np.sin((1.0 - parts) * angle) * one + np.sin(parts * angle) * other
    return np.asarray(directions / math.sin(angle), dtype=np.float64)


def _inside(middle: Floats, border: Sequence[tuple[Floats, Integers]], turn: float) -> Floats:
    """Directions (a, 3) of strips at a corner: the arcs on the border of its normal cone, and some
    between these and its middle, about as far apart."""
    directions = [arc for arc, _ in border]
    if turn >= math.pi:
        return np.concatenate(directions)
    directions.append(middle[None])
    for arc, numbers in border:
        for number, direction in zip(numbers.tolist(), arc, strict=True):
            path = _along(middle, direction, turn)
            # Where paths converge only every second, fourth, ... continues; the one from the
            # saddle always does.
            parts = np.arange(1, len(path) - 1) / (len(path) - 1)
            strides = 2.0 ** np.floor(-np.log2(parts))
            directions.append(path[1:-1][number % strides == 0])
    return np.concatenate(directions)
