"""Meshes that files place in a scene: joined to one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dicedesign.errors import MeshFileError
from dicedesign.geometry.meshes.body import is_rounded
from dicedesign.geometry.meshes.parsing import EXPORT_AGAIN, Geometry
from dicedesign.runtime.arrays import Floats, Integers

MAX_NODES = 1 << 17
"""Limit of the places of meshes in a scene; nodes within themselves have no end."""

MAX_POINTS = 1 << 26
"""Limit of the points of all of them."""


class Part(NamedTuple):
    """Points (n, 3) and triangles (t, 3) of a mesh, or t = 0, and the matrix (4, 4) of its
    place."""

    points: Floats
    triangles: Integers
    matrix: Floats


class Node(NamedTuple):
    """A node of a scene: the matrix (4, 4) in its parent, further nodes, and meshes."""

    matrix: Floats
    children: Sequence[Any]
    meshes: Sequence[tuple[Floats, Integers]]


def join_parts(parts: Sequence[Part], path: Path) -> Geometry:
    """One mesh of the parts that have triangles, or of all if none has."""
    parts = [part for part in parts if len(part.triangles)] or parts
    points, triangles, rounded, count = [], [], False, 0
    for own, faces, matrix in parts:
        rounded = rounded or is_rounded(own)
        moved = own @ matrix[:3, :3].T + matrix[:3, 3]
        points.append(own if np.array_equal(matrix, np.eye(4)) else moved)
        mirrored = np.linalg.det(matrix[:3, :3]) < 0  # a mirror turns a surface inside out
        triangles.append((faces[:, ::-1] if mirrored else faces) + count)
        count += len(own)
    joined = (f"joined {len(parts)} parts of the file",) if len(parts) > 1 else ()
    return Geometry(
        np.concatenate([np.empty((0, 3)), *points]),
        np.concatenate([np.empty((0, 3), dtype=np.int64), *triangles]),
        joined,
        rounded,
    )


def walk(roots: Sequence[Any], node_of: Callable[[Any], Node], path: Path) -> Geometry:
    """Geometry of all meshes below the roots of a scene. Raises MeshFileError: it has no end."""
    parts, visits, points = [], 0, 0
    pending = [(root, np.eye(4)) for root in reversed(roots)]
    while pending:
        root, above = pending.pop()
        node = node_of(root)
        matrix = above @ node.matrix
        parts += [Part(*mesh, matrix) for mesh in node.meshes]
        pending += [(child, matrix) for child in reversed(node.children)]
        visits += 1
        points += sum(len(mesh[0]) for mesh in node.meshes)
        if max(visits, len(pending)) > MAX_NODES or points > MAX_POINTS:
            raise MeshFileError(
                f"{path}: expected at most {MAX_NODES} places of meshes with {MAX_POINTS} points, "
                f"got more, or nodes within themselves; {EXPORT_AGAIN}"
            )
    return join_parts(parts, path)


def quaternion_matrix(x: float, y: float, z: float, w: float) -> Floats:
    """Matrix (3, 3) of a quaternion."""
    square = x * x + y * y + z * z + w * w
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Floats = np.eye(3) + 2.0 / square * (w * cross + cross @ cross)
    return rotation


def triangles_of(order: Integers, mode: int) -> Integers:
    """Triangles (t, 3) of corners (n,) by the mode of a primitive of glTF: 4 for triangles, 5 for a
    strip, 6 for a fan, 0 for points."""
    if mode == 4:
        return order.reshape(-1, 3)
    number = np.arange(max(len(order) - 2, 0) if mode else 0)
    if mode == 6:
        return np.stack([order[0 * number], order[number + 1], order[number + 2]], axis=1)
    odd = number % 2
    strip = np.stack([order[number], order[number + 1 + odd], order[number + 2 - odd]], axis=1)
    # Repeated corners lead on to where a strip continues.
    return strip[(strip != np.roll(strip, 1, axis=1)).all(axis=1)]
