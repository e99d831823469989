"""Starting shapes: convex polyhedra with the directions on which outcomes are to be placed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.geometry.body import Body
from dicedesign.geometry.halfspaces import polyhedron_corners
from dicedesign.rest.poses import rest_poses

__all__ = ["HENDECAHEDRA", "Start", "hendecahedron", "mesh_start", "prism", "repulsion"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """A shape to begin with.

    Attributes
    ----------
    points: (n, 3) whose convex hull is the shape; largest extent about 2.
    directions: (k, 3) unit normals of the facets that carry outcomes, in the order in which an
        assignment names them.
    """

    points: Floats
    directions: Floats


def prism(sides: int, height: float = 1.5, cap: float = 1.3) -> Start:
    """A prism with pointed caps, whose side faces carry the outcomes in order around the axis.

    Parameters
    ----------
    sides: 3 to 12.
    height: height of the side faces in units of the base's circumscribed radius, positive.
    cap: height of each pointed cap in the same unit; steep caps are unstable. Not negative.

    Raises
    ------
    InputError: a parameter out of range.
    """
    if not 3 <= sides <= 12:
        raise InputError(f"start.prism.sides: expected 3 to 12, got {sides}")
    if not height > 0.0:
        raise InputError(f"start.prism.height: expected a positive number, got {height:g}")
    if not cap >= 0.0:
        raise InputError(f"start.prism.cap: expected a number not below 0, got {cap:g}")
    corner = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(corner), np.sin(corner)], axis=1)
    level = np.full((sides, 1), height / 2.0)
    apex = np.array([[0.0, 0.0, height / 2.0 + cap]])
    points = np.concatenate([np.hstack([ring, level]), np.hstack([ring, -level])])
    if cap > 0.0:
        points = np.concatenate([points, apex, -apex])
    middle = corner + np.pi / sides
    directions = np.stack([np.cos(middle), np.sin(middle), np.zeros(sides)], axis=1)
    return Start(_unit_size(points), directions)


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
    Gazette 80, 1996); mirror images follow each other."""
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
    return Start(_unit_size(polyhedron_corners(normals, offsets)), directions)


def _circus() -> Start:
    """A five-sided tent: pentagonal prism under a pentagonal pyramid; wall and roof of each side
    follow each other, the floor comes in the middle."""
    angle = 2.0 * np.pi * np.arange(5) / 5.0
    wall = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    roof = np.stack([np.cos(angle), np.sin(angle), np.full(5, 0.809)], axis=1)
    roof /= np.linalg.norm(roof, axis=1)[:, None]
    floor = np.array([[0.0, 0.0, -1.0]])
    pairs = np.stack([wall, roof], axis=1).reshape(10, 3)
    directions = np.concatenate([pairs[:5], floor, pairs[5:]])
    offsets = np.ones(11)
    return Start(_unit_size(polyhedron_corners(directions, offsets)), directions)


HENDECAHEDRA: dict[str, Callable[[], Start]] = {"bisymmetric": _bisymmetric, "circus": _circus}


def repulsion(outcomes: int, seed: int, steps: int = 400) -> Start:
    """Facets tangent to the unit sphere at points that repel each other like charges.

    Parameters
    ----------
    outcomes: number of facets, at least 4; all carry an outcome.
    seed: of the random first positions.
    steps: of gradient descent on the Coulomb energy.

    Raises
    ------
    InputError: fewer than 4 outcomes.
    """
    if outcomes < 4:
        raise InputError(
            f"start.repulsion: expected at least 4 outcomes, got {outcomes}; a body bounded by "
            "fewer facets does not exist, start from a prism"
        )
    points = np.random.default_rng(seed).normal(size=(outcomes, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    for step in range(steps):
        offset = points[:, None, :] - points[None, :, :]
        distance = np.sqrt((offset * offset).sum(-1)) + np.eye(outcomes)
        force = (offset / distance[..., None] ** 3).sum(axis=1)
        force -= points * (force * points).sum(-1)[:, None]
        length = np.sqrt((force * force).sum(-1)).max()
        reach = 0.3 / np.sqrt(outcomes) * (1.0 - step / steps)
        points += force * (reach / max(length, 1.0))
        points /= np.linalg.norm(points, axis=1)[:, None]
    return Start(_unit_size(polyhedron_corners(points, np.ones(outcomes))), points)


def mesh_start(body: Body, outcomes: int) -> Start:
    """The convex hull of a body, with its `outcomes` most probable rests carrying the outcomes.

    Raises
    ------
    InputError: the hull has fewer rests than outcomes.
    """
    poses = rest_poses(body, "hull")
    if len(poses.normals) < outcomes:
        raise InputError(
            f"start.mesh: expected a body with at least {outcomes} rests, one for each outcome, "
            f"got {len(poses.normals)} in {body.name}; take another start"
        )
    return Start(_unit_size(poses.hull.vertices), poses.normals[:outcomes])


def _unit_size(points: Floats) -> Floats:
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2.0
    return points / np.abs(points).max()
