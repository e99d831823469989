"""Meshes that files place in a scene: joined to one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dicedesign.errors import MeshFileError
from dicedesign.geometry.meshes.body import is_rounded
from dicedesign.geometry.meshes.parsing import EXPORT_AGAIN, Geometry
from dicedesign.geometry.triangles import surface_of
from dicedesign.runtime.arrays import Floats, Integers

MAX_NODES = 20_000
"""Limit of the places of meshes in a scene; nodes within themselves have no end."""

MAX_PLACED = 5_000_000
"""Limit of the vertices and triangles of a body with its repeated parts; twice those in the file
are allowed too."""


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
    parts, visits = list[Part](), 0
    pending = [(root, np.eye(4)) for root in reversed(roots)]
    while pending:
        root, above = pending.pop()
        node = node_of(root)
        matrix = above @ node.matrix
        parts += [Part(*mesh, matrix) for mesh in node.meshes]
        pending += [(child, matrix) for child in reversed(node.children)]
        visits += 1
        if max(visits, len(pending), len(parts)) > MAX_NODES:
            raise MeshFileError(
                f"{path}: expected at most {MAX_NODES} places of meshes, got more, or nodes within "
                f"themselves; {EXPORT_AGAIN}"
            )
    sizes = [len(part.points) + len(part.triangles) for part in parts]
    held = sum({id(part.triangles): size for part, size in zip(parts, sizes, strict=True)}.values())
    limit = max(MAX_PLACED, 2 * held)
    if sum(sizes) > limit:
        raise MeshFileError(
            f"{path}: expected at most {limit} vertices and triangles with all repeated meshes, "
            f"got {sum(sizes)}; {EXPORT_AGAIN}"
        )
    return join_parts(parts, path)


def used_part(points: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Triangles with the points that they use, where many meshes may share one array of points."""
    if 0 < triangles.size < len(points):
        part = surface_of(points, triangles)
        return part.points, part.triangles
    return points, triangles


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
