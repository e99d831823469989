"""Orientations and motions of a die at the moment it is let go."""

from __future__ import annotations

from functools import cache
from typing import Final, Literal, get_args

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import Table, drawn

__all__ = [
    "ORIENTATIONS",
    "PAPER_DIRECTIONS",
    "Orientations",
    "drop_weights",
    "released",
    "released_on",
    "up_directions",
]

Orientations = Literal["uniform", "icosahedron"]
"""At random, or the paper's: up directions at the vertices of a subdivided icosahedron."""

ORIENTATIONS: Final[tuple[Orientations, ...]] = get_args(Orientations)

UPSIDE_DOWN: Final = 1e-12
"""Nearer to down than this, as a part of the vertical, the shortest turn up has no certain axis."""

PAPER_DIRECTIONS: Final = 1212
"""Vertices of the icosahedron whose edges are cut into `SUBDIVISIONS` parts: 10 times their square
plus 2. Source: section 4.1."""

SUBDIVISIONS: Final = 11


@cache
def up_directions() -> tuple[Floats, Floats]:
    """The paper's up directions (1212, 3), unit vectors, and the part of the sphere that each
    stands for, (1212,) summing to 1: the area of its Voronoi cell."""
    # Imported here, as most throws do without.
    from scipy.spatial import ConvexHull, SphericalVoronoi

    golden = (1.0 + np.sqrt(5.0)) / 2.0
    corners = np.array([(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    corners = np.concatenate([np.roll(corners, shift, axis=1) for shift in range(3)])
    parts = np.arange(SUBDIVISIONS + 1)
    i, j = (grid.ravel() for grid in np.meshgrid(parts, parts, indexing="ij"))
    inside = i + j <= SUBDIVISIONS
    weights = np.stack([i, j, SUBDIVISIONS - i - j], axis=1)[inside] / SUBDIVISIONS
    points = (weights @ corners[ConvexHull(corners).simplices]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1)[:, None]
    _, first = np.unique(points.round(9), axis=0, return_index=True)
    directions = points[np.sort(first)]
    areas = SphericalVoronoi(directions).calculate_areas()
    return directions, areas / areas.sum()


def drop_weights(drops: int, orientations: Orientations) -> Floats:
    """Weights (n,) of so many drops: 1 on the mean over the paper's directions."""
    if orientations == "uniform":
        return np.ones(drops)
    return PAPER_DIRECTIONS * up_directions()[1][np.arange(drops) % PAPER_DIRECTIONS]


def released(
    body: RigidBody,
    table: Table,
    numbers: Integers,
    orientations: Orientations,
    rng: np.random.Generator,
) -> Floats:
    """States (n, 13) of a body as it is let go: position (m), quaternion w, x, y, z from principal
    axes to the world, velocity (m/s), angular velocity about the principal axes (rad/s).

    numbers: (n,) of the drops, which say the paper's direction. Of those the body is turned about
    the vertical at random. Nothing is drawn for a height, speed or spin that is one number.
    """
    count = len(numbers)
    states = np.zeros((count, 13))
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    if orientations == "icosahedron":
        yaw = np.arctan2(turns[:, 1], turns[:, 0])
        turns = _standing(up_directions()[0][numbers % PAPER_DIRECTIONS] @ body.axes, yaw)
    axes = rng.normal(size=(count, 3))
    states[:, 3:7] = turns
    spins = np.reshape(drawn(table.spin, count, rng), (-1, 1))
    states[:, 10:13] = spins * axes / np.linalg.norm(axes, axis=1)[:, None]
    states[:, 7] = drawn(table.speed, count, rng)
    states[:, 2] = drawn(table.height, count, rng) - _lowest(body, table, turns)
    return states


def released_on(
    body: RigidBody, table: Table, count: int, down: Floats, rng: np.random.Generator
) -> Floats:
    """The same of throws that begin with one direction (3,) of the body's frame, unit, downward,
    turned about the vertical at random."""
    states = released(body, table, np.arange(count), "uniform", rng)
    yaw = rng.uniform(-np.pi, np.pi, count)
    states[:, 3:7] = _standing(np.tile(-down @ body.axes, (count, 1)), yaw)
    states[:, 2] = drawn(table.height, count, rng) - _lowest(body, table, states[:, 3:7])
    return states


def _lowest(body: RigidBody, table: Table, turns: Floats) -> Floats:
    """(n,) of the lowest point over the center of mass in m; turns: (n, 4) quaternions."""
    w, x, y, z = turns.T
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], 1)
    lowest: Floats = (up @ body.vertices.T).min(axis=1) * table.size / 2.0
    return lowest


def _standing(up: Floats, yaw: Floats) -> Floats:
    """Quaternions (n, 4) that turn directions (n, 3) of the body up, and then by angles (n,) about
    the vertical, in radians."""
    # The shortest turn from u to z has the axis u x z; near its antipode that is any across it.
    real = 1.0 + up[:, 2]
    turn = np.stack([real, up[:, 1], -up[:, 0], np.zeros(len(up))], axis=1)
    turn[real < UPSIDE_DOWN] = (0.0, 1.0, 0.0, 0.0)
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    cosine, sine = np.cos(yaw / 2.0), np.sin(yaw / 2.0)
    w, x, y, z = turn.T
    return np.stack(
        [
            cosine * w - sine * z,
            cosine * x - sine * y,
            cosine * y + sine * x,
            cosine * z + sine * w,
        ],
        axis=1,
    )
