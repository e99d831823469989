"""Motions of a body in the scene: turns, rolls and throws that end at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.simulation import Film
from dicedesign.view.viewed_body import ViewedBody

BODY_POSITION = np.array([-0.9, 0.0, 0.0])
"""Position of the body on the floor, in the scene."""

SPHERE_POSITION = np.array([1.1, 0.0, 0.5])

SPHERE_RADIUS = 0.45


@dataclass(frozen=True)
class SceneFrame:
    """Coordinates of a body in its frame of the scene.

    Attributes
    ----------
    origin: (3,) point of the body at the origin of the frame.
    scale: units of the scene per unit of the body.
    """

    origin: Floats
    scale: float

    @classmethod
    def of(cls, hull: ConvexHull) -> SceneFrame:
        """Frame at the centroid of a hull whose farthest vertex is at distance 1."""
        radius = np.linalg.norm(hull.vertices - hull.centroid, axis=1).max()
        return cls(hull.centroid, float(1.0 / radius))

    def to_scene(self, points: Floats) -> Floats:
        """Transform points (..., 3) of the body to its frame."""
        return (points - self.origin) * self.scale

    def from_scene(self, points: Floats) -> Floats:
        """Transform points (..., 3) of the frame to the body."""
        return points / self.scale + self.origin

    def place(self, pose: Floats) -> tuple[Floats, Floats]:
        """Quaternion (4,), w first, and position (3,) of the frame in the scene.

        pose: (4, 4) motion of the body onto the plane z = 0.
        """
        rotation = pose[:3, :3]
        quaternion = np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))
        return quaternion, BODY_POSITION + self.scale * (rotation @ self.origin + pose[:3, 3])


MAX_STEP_ANGLE = 0.02
"""Radians from one pose to the next."""

ROLL_SPEED = 2.0
"""Radians per second of a rolling body."""

TURN_SECONDS = 0.5


@dataclass(frozen=True, eq=False)
class Motion:
    """Sequence of poses.

    Attributes
    ----------
    poses: (f, 4, 4) motions onto the plane z = 0, in the unit of the body. In the last the center
        of mass is above the origin.
    seconds: (f,) ascending from 0.
    """

    poses: Floats
    seconds: Floats

    def after(self, other: Motion) -> Motion:
        """Append this motion to another."""
        return Motion(
            np.concatenate([other.poses, self.poses]),
            np.concatenate([other.seconds, other.seconds[-1] + self.seconds]),
        )

    def at(self, seconds: float) -> Floats:
        """Pose (4, 4) at a time."""
        return self.poses[max(0, int(np.searchsorted(self.seconds, seconds, "right")) - 1)]


def turn_motion(hull: ConvexHull, start: Floats, end: Floats) -> Motion:
    """Shortest turn from one pose (4, 4) to another, with the lowest point on the plane."""
    turn = Rotation.from_matrix(end[:3, :3] @ start[:3, :3].T)
    count = 2 + int(turn.magnitude() / MAX_STEP_ANGLE)
    parts = np.linspace(0.0, 1.0, count)
    # Slow at both ends.
    eased = (parts * parts * (3.0 - 2.0 * parts))[:, None]
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(eased * turn.as_rotvec()).as_matrix() @ start[:3, :3]
    middle = hull.vertices.mean(axis=0)
    first, last = (pose[:3, :3] @ middle + pose[:3, 3] for pose in (start, end))
    poses[:, :3, 3] = (1.0 - eased) * first + eased * last - poses[:, :3, :3] @ middle
    poses[:, 2, 3] = -(poses[:, 2, :3] @ hull.vertices.T).min(axis=1)
    poses[-1] = end
    return Motion(poses, TURN_SECONDS * parts)


def film_motion(film: Film, center_of_mass: Floats) -> Motion:
    """Motion of a filmed throw, in the unit of the body.

    center_of_mass: (3,) in the frame of the body.
    """
    scale = 2.0 * film.body.radius / film.table.size
    poses = np.tile(np.eye(4), (len(film.seconds), 1, 1))
    poses[:, :3, :3] = film.rotations @ film.body.axes.T
    poses[:, :3, 3] = scale * film.positions - poses[:, :3, :3] @ center_of_mass
    return Motion(_end_at_origin(poses, center_of_mass), film.seconds)


def _end_at_origin(poses: Floats, center: Floats) -> Floats:
    """Move poses along the plane, so that the center of mass ends above the origin."""
    end = poses[-1, :3, :3] @ center + poses[-1, :3, 3]
    moved = poses.copy()
    moved[:, :2, 3] -= end[:2]
    return moved


STANDING_ANGLE = np.radians(0.01)
"""A body within this angle of a rest stands on it."""


def release_motion(viewed: ViewedBody, pose: Floats, down: Floats | None = None) -> Motion:
    """Motion from a pose (4, 4) to rest.

    The body first turns until `down`, a direction (3,) of the body, points down. Without it, it
    rolls from the pose. Source of the roll: algorithm 1.
    """
    poses = viewed.poses
    down = -pose[2, :3] if down is None else down
    angles = angle_between(poses.normals, down)
    nearest = int(angles.argmin())
    if angles[nearest] <= STANDING_ANGLE:
        return turn_motion(viewed.hull, pose, poses.transforms[nearest])
    steps = roll_steps(poses.morse.equilibria, down, MAX_STEP_ANGLE)
    directions = np.array([step.down for step in steps])
    angles = np.linalg.norm(np.diff(directions, axis=0, prepend=directions[:1]), axis=1)
    transforms = _end_at_origin(np.array([step.transform for step in steps]), viewed.center)
    roll = Motion(transforms, np.cumsum(angles) / ROLL_SPEED)
    return roll.after(turn_motion(viewed.hull, pose, roll.poses[0]))
