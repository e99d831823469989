"""A body to throw, and its orientations and motions at the moment it is let go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.meshes.body import Body, solid_triangles
from dicedesign.geometry.triangles import solid_inertia, solid_properties
from dicedesign.rest.poses import RestPoses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.tables import Table, draw
from dicedesign.tolerances import INERTIA_TOLERANCE, VOLUME_TOLERANCE


@dataclass(frozen=True)
class RigidBody:
    """A body in the frame of its principal axes about its center of mass, in units of its radius:
    the largest distance of a point from the center of mass.

    The hull touches the table, whatever hollows the body has. The neighbors of vertex v are the
    entries `start[v] : start[v + 1]` of `neighbors`, `left` and `right`.

    Attributes
    ----------
    name: what messages call it.
    radius: in the body's unit of length.
    axes: (3, 3) principal axes as columns, in the body's own frame, right-handed.
    moments: (3,) principal moments of inertia, ascending, for a mass and a radius of 1.
    vertices: (n, 3) of the hull.
    start: (n + 1,); neighbors: (h,) vertices; left, right: (h,) facets beside the edges to them.
    normals: (m, 3) of the hull's facets.
    rest_of_facet: (m,) the rest to which each facet rolls without momentum.
    rest_normals: (k, 3) of the rests, in the order of `RestPoses`.
    rest_heights: (k,) of the center of mass at rest.
    barriers: (k,) height of the lowest saddle on the border of each basin; infinite if there is
        none.
    """

    name: str
    radius: float
    axes: Floats
    moments: Floats
    vertices: Floats
    start: Integers
    neighbors: Integers
    left: Integers
    right: Integers
    normals: Floats
    rest_of_facet: Integers
    rest_normals: Floats
    rest_heights: Floats
    barriers: Floats

    @property
    def inertia(self) -> Floats:
        """(3, 3) tensor of inertia about the center of mass over the mass, in the body's frame and
        squared unit of length."""
        tensor: Floats = (self.axes * self.moments) @ self.axes.T * self.radius**2
        return tensor


def rigid_body(body: Body, poses: RestPoses, inertia: ArrayLike | None = None) -> RigidBody:
    """The rigid body of a mesh.

    Parameters
    ----------
    body: the mesh or point cloud; poses: its rests.
    inertia: (3, 3) tensor of inertia about the center of mass over the mass, in the body's frame
        and squared unit of length; None takes that of the body's densities, or that of the uniform
        solid about its centroid, or of the uniform solid hull where the body bounds no solid.

    Raises
    ------
    InputError: the tensor is that of no body within the hull: not symmetric, not positive
        definite, with a moment larger than the two others together, or too large.
    DegenerateBodyError: there is none, and the mesh is closed and encloses no volume.
    """
    hull, center, morse = poses.hull, poses.center_of_mass, poses.morse
    arms = hull.vertices - center
    radius = float(np.linalg.norm(arms, axis=1).max())
    tensor = _solid_inertia(body, poses) if inertia is None else _check_inertia(inertia, radius)
    moments, axes = np.linalg.eigh(tensor)
    if np.linalg.det(axes) < 0.0:
        axes = axes * np.array([1.0, 1.0, -1.0])
    vertices = np.ascontiguousarray(arms @ axes / radius)
    order = np.argsort(hull.tail, kind="stable")
    counts = np.bincount(hull.tail, minlength=len(vertices))
    barriers = np.full(len(poses.facets), np.inf)
    heights = (morse.saddles @ axes @ vertices.T).max(axis=1, initial=-np.inf)
    for basins in morse.saddle_basins.T:
        np.minimum.at(barriers, basins, heights)
    normals = np.ascontiguousarray(hull.normals @ axes)
    return RigidBody(
        name=body.name,
        radius=radius,
        axes=axes,
        moments=moments / radius**2,
        vertices=vertices,
        start=np.concatenate([[0], np.cumsum(counts)]),
        neighbors=hull.head[order],
        left=hull.facet[order],
        right=hull.facet[hull.twin[order]],
        normals=normals,
        rest_of_facet=morse.basin_of_facet,
        rest_normals=normals[poses.facets],
        rest_heights=(normals[poses.facets] @ vertices.T).max(axis=1),
        barriers=barriers,
    )


def _solid_inertia(body: Body, poses: RestPoses) -> Floats:
    known = body.mass_properties
    if known is not None and poses.center_of_mass_source != "uniform solid hull":
        return known.inertia
    solid = None if poses.center_of_mass_source == "uniform solid hull" else solid_triangles(body)
    if solid is None:
        return solid_inertia(poses.hull.vertices, poses.hull.triangles)
    volume, _ = solid_properties(body.points, solid[0])
    extent = float(np.ptp(body.points, axis=0).max())
    if abs(volume) <= VOLUME_TOLERANCE * extent**3:
        raise DegenerateBodyError(
            f"{body.name}: expected a closed mesh that encloses a volume, got {volume:.3g} at an "
            f"extent of {extent:.3g}; give its inertia"
        )
    return solid_inertia(body.points, solid[0])


def _check_inertia(inertia: ArrayLike, radius: float) -> Floats:
    tensor = np.asarray(inertia, dtype=np.float64)
    expected = "inertia: expected a symmetric (3, 3) tensor of finite numbers"
    if tensor.shape != (3, 3) or not np.isfinite(tensor).all():
        raise InputError(f"{expected}, got {np.asarray(inertia).tolist()}; give xx,yy,zz,xy,xz,yz")
    size = float(np.abs(tensor).max())
    if np.abs(tensor - tensor.T).max() > INERTIA_TOLERANCE * size:
        raise InputError(f"{expected}, got {tensor.tolist()}; make it equal to its transpose")
    least, middle, most = np.linalg.eigvalsh(tensor).tolist()
    moments = f"{least:.6g}, {middle:.6g} and {most:.6g}"
    if not least > INERTIA_TOLERANCE * size:
        raise InputError(
            "inertia: expected a positive definite tensor, got principal moments of "
            f"{moments}; correct it or leave it out"
        )
    if most > (least + middle) * (1.0 + INERTIA_TOLERANCE):
        raise InputError(
            "inertia: expected no principal moment larger than the two others together, as of "
            f"every body, got {moments}; correct it or leave it out"
        )
    if least + middle + most > 2.0 * radius**2 * (1.0 + INERTIA_TOLERANCE):
        raise InputError(
            f"inertia: expected that of a mass of 1 within {radius:.6g} of its center, whose "
            f"moments sum to at most {2.0 * radius**2:.6g}, got {moments}; divide by the mass and "
            "use the unit of the mesh"
        )
    return 0.5 * (tensor + tensor.T)


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
    """Weights (n,) of drops over the paper's directions, with mean 1."""
    if orientations == "uniform":
        return np.ones(drops)
    return PAPER_DIRECTIONS * up_directions()[1][np.arange(drops) % PAPER_DIRECTIONS]


def release_states(
    body: RigidBody,
    table: Table,
    numbers: Integers,
    orientations: Orientations,
    rng: np.random.Generator,
    down: Floats | None = None,
) -> Floats:
    """States (n, 13) of a body at release: position (m), quaternion w, x, y, z from principal axes
    to the world, velocity (m/s), angular velocity about the principal axes (rad/s).

    numbers: (n,) of the drops, which say the paper's direction. Of those the body is turned about
    the vertical at random, as of throws that begin with one direction `down` (3,) of the body's
    frame, unit, downward. Nothing is drawn for a height, speed or spin that is one number.
    """
    count = len(numbers)
    states = np.zeros((count, 13))
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    if orientations == "icosahedron":
        yaw = np.arctan2(turns[:, 1], turns[:, 0])
        turns = _standing(up_directions()[0][numbers % PAPER_DIRECTIONS] @ body.axes, yaw)
    axes = rng.normal(size=(count, 3))
    spins = np.reshape(draw(table.spin, count, rng), (-1, 1))
    states[:, 10:13] = spins * axes / np.linalg.norm(axes, axis=1)[:, None]
    states[:, 7] = draw(table.speed, count, rng)
    heights = draw(table.height, count, rng)
    if down is not None:
        yaw = rng.uniform(-np.pi, np.pi, count)
        turns = _standing(np.tile(-down @ body.axes, (count, 1)), yaw)
        # Each seed's throws stay those that they were.
        heights = draw(table.height, count, rng)
    states[:, 3:7] = turns
    # Of the lowest point over the center of mass.
    lowest = (vertical(turns) @ body.vertices.T).min(axis=1) * table.size / 2.0
    states[:, 2] = heights - lowest
    return states


def vertical(turns: Floats) -> Floats:
    """(..., 3) directions of the body that are up after it is turned by quaternions (..., 4)."""
    w, x, y, z = turns.T
    up = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return np.stack(up, axis=-1)


def _standing(up: Floats, yaw: Floats) -> Floats:
    """Quaternions (n, 4) that turn directions (n, 3) of the body up, and then by angles (n,) about
    the vertical, in radians."""
    # The shortest turn from u to z has the axis u x z; near its antipode that is any across it.
    real = 1.0 + up[:, 2]
    turn = np.stack([real, up[:, 1], -up[:, 0], np.zeros(len(up))], axis=1)
    turn[real < UPSIDE_DOWN] = (0.0, 1.0, 0.0, 0.0)
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    cosine, sine = np.cos(yaw / 2.0), np.sin(yaw / 2.0)
    w, x, y, _ = turn.T
    return np.stack([cosine * w, cosine * x - sine * y, cosine * y + sine * x, sine * w], axis=1)
