"""Rigid bodies to throw, and their orientations and motions at release."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dicedesign.geometry.meshes.body import Body, body_of
from dicedesign.geometry.triangles import Surface, principal_axes
from dicedesign.rest.poses import RestPoses, mass_properties, rest_poses
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.tables import Table, draw


@dataclass(frozen=True)
class RigidBody:
    """Body in the frame of its principal axes about its center of mass, in units of its radius: the
    largest distance of a point from the center of mass.

    Its hull touches the table. The neighbors of vertex v are the entries `start[v] : start[v + 1]`
    of `neighbors`, `left` and `right`.

    Attributes
    ----------
    name: used in messages.
    radius: in the body's unit of length.
    axes: (3, 3) principal axes as columns, in the body's own frame, right-handed.
    moments: (3,) principal moments of inertia, ascending, for a mass and a radius of 1.
    vertices: (n, 3) of the hull.
    start: (n + 1,); neighbors: (h,) vertices; left, right: (h,) facets beside the edges to them.
    normals: (m, 3) of the hull's facets.
    rest_of_facet: (m,) rest to which the body rolls from each facet without momentum.
    rest_normals: (k, 3) of the rests, in the order of `RestPoses`.
    rest_heights: (k,) of the center of mass at rest.
    barriers: (k,) height of the lowest saddle on the border of each basin; infinite without one.
    flat: (k, 3) of each rest the height of the center of mass, the least distance of an edge from
        its foot, and the product of inertia about the foot's normal over the mass, by which a body
        that spins about it turns over.
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
    flat: Floats

    def digest(self, *settings: Any) -> str:
        """SHA-256 of the body and of settings of its throws."""
        shape = self.vertices.tobytes() + self.moments.tobytes()
        return hashlib.sha256(shape + repr(settings).encode()).hexdigest()

    @property
    def inertia(self) -> Floats:
        """(3, 3) tensor of inertia about the center of mass per mass, in the body's frame and
        squared unit of length."""
        tensor: Floats = (self.axes * self.moments) @ self.axes.T * self.radius**2
        return tensor


def rigid_body(
    points_or_mesh: ArrayLike | Body | Surface,
    poses: RestPoses | None = None,
    inertia: Floats | None = None,
) -> RigidBody:
    """Rigid body of a mesh or point cloud.

    Parameters
    ----------
    points_or_mesh: as for `dicedesign.rest_poses`.
    poses: its rests; None for `dicedesign.rest_poses(points_or_mesh)`.
    inertia: (3, 3) tensor of inertia about the center of mass per mass, in the body's frame and
        squared unit of length; None takes the tensor of the body's densities, or of the uniform
        solid about its centroid, or of the uniform solid hull if the body bounds no solid.

    Raises DegenerateBodyError if the mesh is closed and encloses no volume, and without rests as
    `dicedesign.rest_poses`.
    """
    body = body_of(points_or_mesh)
    poses = poses or rest_poses(body)
    center, morse = poses.center_of_mass, poses.with_flat_facets().morse
    hull = morse.equilibria.hull
    arms = hull.vertices - center
    radius = float(np.linalg.norm(arms, axis=1).max())
    if inertia is None:
        inertia = mass_properties(body, poses).inertia
    moments, axes = principal_axes(inertia)
    vertices = np.ascontiguousarray(arms @ axes / radius)
    start, order = hull.outgoing
    barriers = np.full(len(poses.facets), np.inf)
    heights = (morse.saddles @ axes @ vertices.T).max(axis=1, initial=-np.inf)
    for basins in morse.saddle_basins.T:
        np.minimum.at(barriers, basins, heights)
    rest_normals = poses.normals @ axes
    rest_heights = (rest_normals @ vertices.T).max(axis=1)
    turned = rest_normals * moments / radius**2
    products = turned - (turned * rest_normals).sum(axis=1)[:, None] * rest_normals
    distances = poses.hull.foot_depths(center)[poses.facets] / radius
    return RigidBody(
        name=body.name,
        radius=radius,
        axes=axes,
        moments=moments / radius**2,
        vertices=vertices,
        start=start,
        neighbors=hull.head[order],
        left=hull.facet[order],
        right=hull.facet[hull.twin[order]],
        normals=np.ascontiguousarray(hull.normals @ axes),
        rest_of_facet=morse.basin_of_facet,
        rest_normals=rest_normals,
        rest_heights=rest_heights,
        barriers=barriers,
        flat=np.column_stack([rest_heights, distances, np.linalg.norm(products, axis=1)]),
    )


UPSIDE_DOWN = 1e-12
"""Distance of a direction's vertical part from -1 below which the shortest turn up is
undetermined."""


def release_states(
    body: RigidBody,
    table: Table,
    count: int,
    rng: np.random.Generator,
    down: Floats | None = None,
) -> Floats:
    """Random states (n, 13) of a body at release: position (m), quaternion w, x, y, z from
    principal axes to the world, velocity (m/s), angular velocity about the principal axes (rad/s).

    count: n. down: (3,) or (n, 3) unit directions of the body's frame that point down, about which
    it is turned at random; None for uniform orientations. Nothing is drawn for a height, speed or
    spin that is one number.
    """
    states = np.zeros((count, 13))
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    axes = rng.normal(size=(count, 3))
    spins = np.reshape(draw(table.spin, count, rng), (-1, 1))
    states[:, 10:13] = spins * axes / np.linalg.norm(axes, axis=1)[:, None]
    states[:, 7] = draw(table.speed, count, rng)
    heights = draw(table.height, count, rng)
    if down is not None:
        yaw = rng.uniform(-np.pi, np.pi, count)
        turns = _turn_up(np.broadcast_to(-down @ body.axes, (count, 3)), yaw)
        # A second draw keeps throws identical to those of earlier versions for a seed.
        heights = draw(table.height, count, rng)
    states[:, 3:7] = turns
    # Height of the lowest point relative to the center of mass.
    lowest = (vertical(turns) @ body.vertices.T).min(axis=1) * table.size / 2.0
    states[:, 2] = heights - lowest
    return states


def vertical(turns: Floats) -> Floats:
    """(..., 3) directions of the body that point up after a turn by quaternions (..., 4)."""
    w, x, y, z = turns.T
    up = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return np.stack(up, axis=-1)


def _turn_up(up: Floats, yaw: Floats) -> Floats:
    """Quaternions (n, 4) that turn directions (n, 3) of the body up and then turn about the
    vertical by angles (n,) in radians."""
    # The shortest turn from u to z is about u x z; from the opposite of z, about any normal of z.
    real = 1.0 + up[:, 2]
    turn = np.stack([real, up[:, 1], -up[:, 0], np.zeros(len(up))], axis=1)
    turn[real < UPSIDE_DOWN] = (0.0, 1.0, 0.0, 0.0)
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    cosine, sine = np.cos(yaw / 2.0), np.sin(yaw / 2.0)
    w, x, y, _ = turn.T
    return np.stack([cosine * w, cosine * x - sine * y, cosine * y + sine * x, sine * w], axis=1)
