"""The closed surface that a body's triangles make, checked before anything is done to it."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body
from dicedesign.geometry.meshes.winding import consistent_winding
from dicedesign.geometry.solid import is_closed, solid_properties
from dicedesign.geometry.sphere import signed_solid_angle
from dicedesign.geometry.surfaces.self_intersections import intersecting_triangles
from dicedesign.geometry.surfaces.surface import Surface
from dicedesign.geometry.triangles import edge_neighbors
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.tolerances import VOLUME_TOLERANCE

__all__ = ["make_surface", "shells_and_sheets"]

_REPAIR: Final = "repair the mesh, in MeshLab or Blender for example, and export it again"


def make_surface(body: Body) -> tuple[Surface, tuple[str, ...]]:
    """The surface of one solid that the triangles of a body bound.

    Triangles that are wound against their neighbors are reversed, a surface that is oriented inward
    is turned, and points on no triangle are dropped.

    Returns
    -------
    The surface, and what was repaired, one sentence each, after the notes of the body.

    Raises
    ------
    InputError: the body is a point cloud; its surface is open or one-sided, has an edge with more
        than two triangles or a point where several sheets meet, consists of several shells, or
        intersects itself.
    DegenerateBodyError: the surface encloses no volume.
    """
    name = body.name
    if body.triangles is None:
        raise InputError(
            f"{name}: expected a closed triangle mesh, got a point cloud; export the surface as a "
            "mesh"
        )
    _check_edges(body.triangles, name)
    triangles, notes = _oriented(body.triangles, name)
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = body.points[used], triangles.reshape(-1, 3)
    if len(used) < len(body.points):
        notes.append(f"dropped {len(body.points) - len(used)} points that are on no triangle")
    _check_shells(points, triangles, name)
    volume, _ = solid_properties(points, triangles)
    extent = float(np.ptp(points, axis=0).max())
    if abs(volume) <= VOLUME_TOLERANCE * extent**3:
        raise DegenerateBodyError(
            f"{name}: expected a surface that encloses a volume, got {volume:.3g} at an extent of "
            f"{extent:.3g}; use a mesh with thickness"
        )
    if volume < 0.0:
        triangles = triangles[:, ::-1].copy()
        notes.append("turned the surface, which was oriented inward")
    _check_intersections(points, triangles, name)
    return Surface(points, triangles), (*body.notes, *notes)


def shells_and_sheets(triangles: Integers) -> tuple[Integers, Integers]:
    """Which triangles hang together, and the points where several sheets meet.

    triangles: (t, 3) of a closed oriented surface, each edge in two of them. Returns (t,) the shell
    of each triangle, numbered from 0, triangles being joined by edges, and the rising indices of
    points around which the triangles make more than one ring.
    """
    neighbors = edge_neighbors(triangles)
    shell = _components(np.repeat(np.arange(len(triangles)), 3), neighbors.ravel(), len(triangles))
    across = np.roll(neighbors, -1, axis=1)  # the next triangle around the same corner
    corner = (triangles[across] == triangles[:, :, None]).argmax(axis=2)
    following = (3 * across + corner).ravel()
    ring = _components(np.arange(triangles.size), following, triangles.size)
    rings = np.unique(np.stack((triangles.ravel(), ring)), axis=1)
    return shell, np.flatnonzero(np.bincount(rings[0]) > 1)


def _components(tails: Integers, heads: Integers, count: int) -> Integers:
    graph = coo_array((np.ones(len(tails)), (tails, heads)), shape=(count, count))
    labels: Integers = connected_components(graph, directed=False)[1].astype(np.int64)
    return labels


def _check_edges(triangles: Integers, name: str) -> None:
    tails, heads = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    keys = np.minimum(tails, heads) * (int(triangles.max()) + 1) + np.maximum(tails, heads)
    _, uses = np.unique(keys, return_counts=True)
    open_edges, crowded = np.count_nonzero(uses == 1), np.count_nonzero(uses > 2)
    expected = f"{name}: expected a closed surface in which each edge joins two triangles, got"
    if crowded:
        raise InputError(
            f"{expected} {crowded} edges with more than two triangles (not a manifold); {_REPAIR}"
        )
    if open_edges:
        raise InputError(
            f"{expected} {open_edges} edges with one triangle (the mesh is open); close its holes "
            f"or {_REPAIR}"
        )


def _oriented(triangles: Integers, name: str) -> tuple[Integers, list[str]]:
    if is_closed(triangles):
        return triangles, []
    oriented = consistent_winding(triangles)
    if oriented is None:
        raise InputError(
            f"{name}: expected a surface with an inside and an outside, got a one-sided one (not "
            "orientable, like a Klein bottle); use the surface of a solid"
        )
    count = np.count_nonzero((oriented != triangles).any(axis=1))
    return oriented, [f"reversed {count} triangles that were wound against their neighbors"]


def _check_shells(points: Floats, triangles: Integers, name: str) -> None:
    shell, pinched = shells_and_sheets(triangles)
    sizes = np.bincount(shell)
    if len(sizes) > 1:
        largest = triangles[shell == sizes.argmax()]
        inside = sum(
            _is_inside(points[triangles[np.argmax(shell == k)]].mean(axis=0), points[largest])
            for k in range(len(sizes))
            if k != sizes.argmax()
        )
        raise InputError(
            f"{name}: expected one connected surface, got {len(sizes)} shells: the largest of "
            f"{sizes.max()} triangles, {inside} inside it (cavities or parts) and "
            f"{len(sizes) - 1 - inside} outside; keep one shell, join the parts by a boolean union "
            "or fill the cavities"
        )
    if len(pinched) > 0:
        raise InputError(
            f"{name}: expected one sheet of the surface at each point, got several at "
            f"{len(pinched)} points (not a manifold), the first at "
            f"{_place(points[pinched[0]])}; {_REPAIR}"
        )


def _is_inside(point: Floats, shell: Floats) -> bool:
    a, b, c = (shell - point).transpose(1, 0, 2)
    return abs(float(signed_solid_angle(a, b, c, np).sum())) > 2.0 * np.pi


def _check_intersections(points: Floats, triangles: Integers, name: str) -> None:
    pairs = intersecting_triangles(points, triangles)
    if len(pairs) > 0:
        first = points[triangles[pairs[0]]].mean(axis=(0, 1))
        raise InputError(
            f"{name}: expected a surface that does not meet itself, got {len(pairs)} pairs of "
            f"triangles that do, the first near {_place(first)} (triangles {pairs[0, 0]} and "
            f"{pairs[0, 1]}); resolve them by a boolean union or a remesh, and export the mesh "
            "again"
        )


def _place(point: Floats) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
