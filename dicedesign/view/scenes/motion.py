"""Motions of a body on the floor, as poses and the seconds at which it has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.equilibria import Equilibria
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.film import Film

__all__ = ["Motion", "filmed", "rolled", "turned"]

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
