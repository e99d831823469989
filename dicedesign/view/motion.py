"""Motions of a body in the scene: turned, rolled, thrown, and let go until it rests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.poses import standing_transform
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.simulation import Film
from dicedesign.view.viewed_body import ViewedBody

BODY_AT: Final = np.array([-1.3, 0.0, 0.0])
"""The point of the floor on which the body stands."""

SPHERE_AT: Final = np.array([1.3, 0.0, 1.0])

SPHERE_RADIUS: Final = 0.95


@dataclass(frozen=True)
class Place:
    """From a body's coordinates to the scene's and back.

    Attributes
    ----------
    origin: (3,) point of the body that is the origin of its frame in the scene; scale: scene units
    for one of the body's.
    """

    origin: Floats
    scale: float

    @classmethod
    def of(cls, hull: ConvexHull) -> Place:
        """The farthest corner of the hull is 1 from the origin."""
        radius = np.linalg.norm(hull.vertices - hull.centroid, axis=1).max()
        return cls(hull.centroid, float(1.0 / radius))

    def into_scene(self, points: Floats) -> Floats:
        """Points (..., 3) of the body in its frame of the scene."""
        return (points - self.origin) * self.scale

    def from_scene(self, points: Floats) -> Floats:
        """The way back."""
        return points / self.scale + self.origin

    def frame(self, pose: Floats) -> tuple[Floats, Floats]:
        """Quaternion (4,) and position (3,) of the body's frame in the scene, for a pose (4, 4)
        that puts the body onto the plane z = 0."""
        turned = pose[:3, :3]
        return quaternion(turned), BODY_AT + self.scale * (turned @ self.origin + pose[:3, 3])

    def motion(self, wxyz: Floats, position: Floats, start: Floats) -> Floats:
        """The motion (4, 4) of the body's points that carries something at `start` (3,), a point of
        the body, as a gizmo was moved and turned in the body's frame."""
        motion = np.eye(4)
        motion[:3, :3] = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
        motion[:3, 3] = self.from_scene(position) - motion[:3, :3] @ start
        return motion


def quaternion(rotation: Floats) -> Floats:
    """(4,) unit, w, x, y, z, of a rotation matrix (3, 3)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


STEP: Final = 0.02
"""Largest angle in radians from one pose to the next."""

SPEED: Final = 2.0
"""Radians in a second of a body that rolls."""

TURN_SECONDS: Final = 0.5


@dataclass(frozen=True, eq=False)
class Motion:
    """Attributes
    ----------
    poses: (f, 4, 4) motions onto the plane z = 0, in the body's unit; the last has its center of
        mass above the origin.
    seconds: (f,) ascending from 0.
    """

    poses: Floats
    seconds: Floats

    def after(self, other: Motion) -> Motion:
        """The other motion, and then this one."""
        return Motion(
            np.concatenate([other.poses, self.poses]),
            np.concatenate([other.seconds, other.seconds[-1] + self.seconds]),
        )

    def at(self, seconds: float) -> Floats:
        """The pose (4, 4) at a time."""
        return self.poses[max(0, int(np.searchsorted(self.seconds, seconds, "right")) - 1)]


def turned(hull: ConvexHull, start: Floats, end: Floats, seconds: float = TURN_SECONDS) -> Motion:
    """From one pose (4, 4) into another by the shortest turn, the lowest point on the plane."""
    turn = Rotation.from_matrix(end[:3, :3] @ start[:3, :3].T)
    count = 2 + int(turn.magnitude() / STEP)
    parts = np.linspace(0.0, 1.0, count)
    # Slow at both ends.
    eased = parts * parts * (3.0 - 2.0 * parts)
    vector = turn.as_rotvec()
    poses = np.tile(np.eye(4), (count, 1, 1))
    middle = hull.vertices.mean(axis=0)
    ends = [pose[:3, :3] @ middle + pose[:3, 3] for pose in (start, end)]
    for pose, part in zip(poses, eased, strict=True):
        pose[:3, :3] = Rotation.from_rotvec(part * vector).as_matrix() @ start[:3, :3]
        pose[:3, 3] = (1.0 - part) * ends[0] + part * ends[1] - pose[:3, :3] @ middle
        pose[2, 3] = -(hull.vertices @ pose[2, :3]).min()
    poses[-1] = end
    return Motion(poses, seconds * parts)


def rolled(equilibria: Equilibria, down: Floats) -> Motion:
    """A body that is let go with a direction (3,) downward, until it rests. Source: algorithm 1."""
    steps = roll_steps(equilibria, down, STEP)
    poses = np.array([step.transform for step in steps])
    directions = np.array([step.down for step in steps])
    angles = np.linalg.norm(np.diff(directions, axis=0, prepend=directions[:1]), axis=1)
    return Motion(_ending_here(poses, equilibria.center_of_mass), np.cumsum(angles) / SPEED)


def filmed(film: Film, center_of_mass: Floats) -> Motion:
    """A thrown body in its own unit, as it was filmed; its center of mass (3,) in its frame."""
    scale = 2.0 * film.body.radius / film.table.size
    poses = np.tile(np.eye(4), (len(film.seconds), 1, 1))
    poses[:, :3, :3] = film.rotations @ film.body.axes.T
    poses[:, :3, 3] = scale * film.positions - poses[:, :3, :3] @ center_of_mass
    return Motion(_ending_here(poses, center_of_mass), film.seconds)


def _ending_here(poses: Floats, center: Floats) -> Floats:
    """The poses moved along the plane, so that the center of mass ends above the origin."""
    end = poses[-1, :3, :3] @ center + poses[-1, :3, 3]
    moved = poses.copy()
    moved[:, :2, 3] -= end[:2]
    return moved


STANDS: Final = np.radians(0.01)
"""A body within this angle of a rest stands on it."""


def settled(viewed: ViewedBody, pose: Floats) -> Motion:
    """From a pose (4, 4) to rest, as the body rolls from there."""
    return let_go(viewed, pose, -pose[2, :3])


def let_go(viewed: ViewedBody, pose: Floats, down: Floats) -> Motion:
    """From a pose (4, 4), turned until a direction (3,) points down, and from there to rest."""
    poses = viewed.poses
    angles = angle_between(poses.normals, down)
    nearest = int(angles.argmin())
    if angles[nearest] <= STANDS:
        height = float(poses.hull.heights(poses.center_of_mass)[poses.facets[nearest]])
        end = standing_transform(poses.normals[nearest], height, poses.center_of_mass)
        return turned(viewed.hull, pose, end)
    roll = rolled(poses.morse.equilibria, down)
    return roll.after(turned(viewed.hull, pose, roll.poses[0]))
