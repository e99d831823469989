"""Motions of a body that end at rest: thrown, or set down gently."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import angle_between
from dicedesign.rest.poses import RestPoses
from dicedesign.rest.roll import roll_steps
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.simulation import Film

MAX_STEP_ANGLE = 0.02
"""Radians from one moment of a roll to the next."""

ROLL_SPEED = 2.0
"""Radians per second of a rolling body."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Moments of a motion on the table z = 0, in the unit of the body.

    Attributes
    ----------
    seconds: (f,) ascending from 0.
    rotations: (f, 3, 3) from the body's frame to the table's.
    positions: (f, 3) of the center of mass, which ends above the origin.
    """

    seconds: Floats
    rotations: Floats
    positions: Floats

    @classmethod
    def ending_at_origin(cls, seconds: Floats, rotations: Floats, positions: Floats) -> Motion:
        """Motion that is moved along the table until it ends above the origin."""
        return cls(seconds, rotations, positions - positions[-1] * [1.0, 1.0, 0.0])

    @property
    def quaternions(self) -> Floats:
        """(f, 4) of the rotations: x, y, z, w."""
        return np.asarray(Rotation.from_matrix(self.rotations).as_quat())


def film_motion(film: Film) -> Motion:
    """Motion of a filmed throw, in the unit of the body."""
    scale = 2.0 * film.body.radius / film.table.size
    rotations = film.rotations @ film.body.axes.T
    return Motion.ending_at_origin(film.seconds, rotations, scale * film.positions)


def release_motion(poses: RestPoses, down: Floats) -> tuple[Motion, int]:
    """Motion of a body that is set down and rolls without momentum, and the rest at its end.

    down: (3,) unit direction of the body that points down at release. Source: algorithm 1.
    """
    steps = roll_steps(poses.morse.equilibria, down, MAX_STEP_ANGLE)
    downs = np.array([step.down for step in steps])
    transforms = np.array([step.transform for step in steps])
    angles = np.linalg.norm(np.diff(downs, axis=0, prepend=downs[:1]), axis=1)
    positions = transforms[:, :3, :3] @ poses.center_of_mass + transforms[:, :3, 3]
    rest = int(angle_between(poses.normals, downs[-1]).argmin())
    seconds = np.cumsum(angles) / ROLL_SPEED
    return Motion.ending_at_origin(seconds, transforms[:, :3, :3], positions), rest
