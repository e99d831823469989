"""Starting shapes: convex polyhedra with the directions on which outcomes are to be placed.

Each is made in its own coordinates, which its docstring describes, and then moved and scaled to
half extent 1; `Start` remembers how.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.geometry.body import Body
from dicedesign.geometry.halfspaces import polyhedron_corners
from dicedesign.geometry.hull import ConvexHull, convex_hull
from dicedesign.rest.poses import rest_poses

__all__ = [
    "FEWEST_FACETS",
    "HENDECAHEDRA",
    "Start",
    "hendecahedron",
    "mesh_start",
    "normalised_start",
    "prism",
    "repulsion",
    "spread_directions",
]

Floats = NDArray[np.float64]

FEWEST_FACETS: Final = 4
"""A body bounded by planes has at least so many facets."""

REPULSION_STEPS: Final = 400
"""Steps of gradient descent on the Coulomb energy."""


@dataclass(frozen=True)
class Start:
    """A shape to begin with.

    Attributes
    ----------
    points: (n, 3) whose convex hull is the shape, of half extent 1 about the middle of its box.
    directions: (k, 3) unit normals of the facets that carry outcomes, in the order in which an
        assignment names them.
    origin, scale: how the points were normalised: (3,) and a length in the shape's own
        coordinates, with point = (own - origin) / scale.
    notes: what was repaired or assumed on the way in, one sentence each.
    """

    points: Floats
    directions: Floats
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0
    notes: tuple[str, ...] = ()

    def normalised(self, own: Floats) -> Floats:
        """Points (..., 3) of the shape's own coordinates in those of `points`."""
        return (own - self.origin) / self.scale

    def about_centroid(self) -> Start:
        """The same start, moved so that its centroid is at 0."""
        centroid = convex_hull(self.points).centroid
        origin = self.origin + self.scale * centroid
        return replace(self, points=self.points - centroid, origin=origin)


def prism(sides: int, height: float = 1.5, cap: float = 1.3) -> Start:
    """A prism with pointed caps, whose side faces carry the outcomes in order around the axis.

    Own coordinates: the center at the origin, the axis along z, the base's circumscribed radius 1,
    a corner of the base in direction x.

    Parameters
    ----------
    sides: 3 to 12.
    height: height of the side faces in units of the base's circumscribed radius, positive and
        finite.
    cap: height of each pointed cap in the same unit, not negative and finite; steep caps are
        unstable.

    Raises
    ------
    InputError: a parameter out of range.
    """
    if not 3 <= sides <= 12:
        raise InputError(
            f"start.prism.sides: expected 3 to 12, got {sides}; start from repulsion or a mesh"
        )
    if not 0.0 < height < np.inf:
        raise InputError(
            f"start.prism.height: expected a positive number, got {height:g}; leave it out for 1.5"
        )
    if not 0.0 <= cap < np.inf:
        raise InputError(
            f"start.prism.cap: expected a number not below 0, got {cap:g}; leave it out for 1.3"
        )
    corner = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(corner), np.sin(corner)], axis=1)
    level = np.full((sides, 1), height / 2.0)
    apex = np.array([[0.0, 0.0, height / 2.0 + cap]])
    points = np.concatenate([np.hstack([ring, level]), np.hstack([ring, -level])])
    if cap > 0.0:
        points = np.concatenate([points, apex, -apex])
    middle = corner + np.pi / sides
    directions = np.stack([np.cos(middle), np.sin(middle), np.zeros(sides)], axis=1)
    return normalised_start(points, directions)


def hendecahedron(kind: str) -> Start:
    """An 11-faced polyhedron for the total of two dice; `kind` is a key of `HENDECAHEDRA`.

    Raises InputError for another kind.
    """
    if kind not in HENDECAHEDRA:
        raise InputError(
            f"start.hendecahedron: expected one of {', '.join(HENDECAHEDRA)}, got {kind!r}"
        )
    return HENDECAHEDRA[kind]()


def _bisymmetric() -> Start:
    """The space-filling hendecahedron with two mirror planes (G. Inchbald, The Mathematical
    Gazette 80, 1996); mirror images follow each other.

    Own coordinates: the mirror planes are x = 0 and y = 0, the floor is at z = -1.2, the top at
    z = 1.8, and x and y run from -2 to 2.
    """
    normals = np.array(
        [
            (1, 0, 2),
            (0, 1, 1),
            (1, 1, -1),
            (1, -1, -1),
            (2, 0, -1),
            (0, 0, -1),
            (-2, 0, -1),
            (-1, -1, -1),
            (-1, 1, -1),
            (0, -1, 1),
            (-1, 0, 2),
        ],
        dtype=np.float64,
    )
    inside = np.array([0.0, 0.0, 1.2])
    offsets = np.array([6, 3, 1, 1, 2, 0, 2, 1, 1, 3, 6]) - normals @ inside
    directions = normals / np.linalg.norm(normals, axis=1)[:, None]
    return normalised_start(polyhedron_corners(normals, offsets), directions)


def _circus() -> Start:
    """A five-sided tent: pentagonal prism under a pentagonal pyramid; wall and roof of each side
    follow each other, the floor comes in the middle.

    Own coordinates: every facet is tangent to the unit sphere about the origin, the floor is at
    z = -1, and the first wall faces x.
    """
    angle = 2.0 * np.pi * np.arange(5) / 5.0
    wall = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    roof = np.stack([np.cos(angle), np.sin(angle), np.full(5, 0.809)], axis=1)
    roof /= np.linalg.norm(roof, axis=1)[:, None]
    floor = np.array([[0.0, 0.0, -1.0]])
    pairs = np.stack([wall, roof], axis=1).reshape(10, 3)
    directions = np.concatenate([pairs[:5], floor, pairs[5:]])
    offsets = np.ones(11)
    return normalised_start(polyhedron_corners(directions, offsets), directions)


HENDECAHEDRA: dict[str, Callable[[], Start]] = {"bisymmetric": _bisymmetric, "circus": _circus}


def repulsion(outcomes: int, seed: int) -> Start:
    """Facets tangent to the unit sphere at points that repel each other like charges.

    Own coordinates: the unit sphere has its center at the origin.

    Parameters
    ----------
    outcomes: number of facets, at least `FEWEST_FACETS`; all carry an outcome.
    seed: of the random first positions.

    Raises
    ------
    InputError: fewer than 4 outcomes.
    """
    if outcomes < FEWEST_FACETS:
        raise InputError(
            f"start.repulsion: expected at least {FEWEST_FACETS} outcomes, got {outcomes}; a "
            "body bounded by fewer facets does not exist, start from a prism"
        )
    points = spread_directions(outcomes, np.random.default_rng(seed), REPULSION_STEPS)
    return normalised_start(polyhedron_corners(points, np.ones(outcomes)), points)


def spread_directions(count: int, rng: np.random.Generator, steps: int) -> Floats:
    """(count, 3) random unit vectors that repel each other like charges, after so many steps of
    gradient descent on the Coulomb energy."""
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    for step in range(steps):
        offset = points[:, None, :] - points[None, :, :]
        distance = np.sqrt((offset * offset).sum(-1)) + np.eye(count)
        force = (offset / distance[..., None] ** 3).sum(axis=1)
        force -= points * (force * points).sum(-1)[:, None]
        length = np.sqrt((force * force).sum(-1)).max()
        reach = 0.3 / np.sqrt(count) * (1.0 - step / steps)
        points += force * (reach / max(length, 1.0))
        points /= np.linalg.norm(points, axis=1)[:, None]
    return points


def mesh_start(body: Body, outcomes: int, center_of_mass: Floats | None = None) -> Start:
    """The convex hull of a body, with its `outcomes` most probable rests carrying the outcomes.

    Own coordinates: those of the body.

    Parameters
    ----------
    body: any mesh or point cloud.
    outcomes: how many rests carry an outcome.
    center_of_mass: (3,) in the body's unit, or None for that of the uniform solid hull.

    Raises
    ------
    InputError: the hull has fewer rests than outcomes.
    DegenerateBodyError, OutsideHullError: as `dicedesign.rest_poses`.
    """
    poses = rest_poses(body, "hull" if center_of_mass is None else center_of_mass)
    if len(poses.normals) < outcomes:
        raise InputError(
            f"start.mesh: expected a body with at least {outcomes} rests, one for each outcome, "
            f"got {len(poses.normals)} in {body.name}; take another start"
        )
    return normalised_start(_exact_corners(poses.hull), poses.normals[:outcomes], poses.notes)


def _exact_corners(hull: ConvexHull) -> Floats:
    """(n, 3) corners where the planes of a hull's facets meet. Rounded coordinates scatter about
    the plane of a merged facet; these lie on it, so that it stays one facet."""
    start = hull.facet_start[:-1]
    offsets = ((hull.vertices[hull.tail] - hull.centroid) * hull.normals[hull.facet]).sum(-1)
    heights = np.add.reduceat(offsets, start) / np.diff(hull.facet_start)
    return polyhedron_corners(hull.normals, heights) + hull.centroid


def normalised_start(points: Floats, directions: Floats, notes: tuple[str, ...] = ()) -> Start:
    """A start in normalised coordinates from points (n, 3) and unit directions (k, 3)."""
    origin = (points.min(axis=0) + points.max(axis=0)) / 2.0
    centered = points - origin
    scale = float(np.abs(centered).max())
    return Start(centered / scale, directions, origin, scale, notes)
