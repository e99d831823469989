"""One throw from the hand to its end, as a sequence of poses to look at."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Floats
from dicedesign.throws.engines import GRAVITY, contact_of
from dicedesign.throws.native import advance
from dicedesign.throws.release import released, released_on
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import Table
from dicedesign.tolerances import STANDING_ANGLE

FRAMES_PER_SECOND: Final = 100
"""Of the motion, not of its display."""

CANDIDATES: Final = 25
"""Throws of which that of median length is filmed: neither one that stops at once nor a freak."""

SETTLED: Final = 0.02
"""Speed below which a die is at rest to the eye, in units of the square root of radius times
gravity: some 7 mm/s for a die of 25 mm."""


@dataclass(frozen=True)
class Film:
    """The poses of one thrown body.

    Attributes
    ----------
    body: what was thrown; table: onto what.
    seconds: (f,) since it was let go, 1 / `FRAMES_PER_SECOND` apart.
    positions: (f, 3) of the center of mass in m, the table being z = 0.
    quaternions: (f, 4) unit, w, x, y, z, from the principal axes to the world.
    rest: that it lies on in the end, in the order of `RestPoses`; -1 for a throw that was given up.
    """

    body: RigidBody
    table: Table
    seconds: Floats
    positions: Floats
    quaternions: Floats
    rest: int

    @cached_property
    def rotations(self) -> Floats:
        """(f, 3, 3) matrices of the quaternions."""
        return np.asarray(Rotation.from_quat(self.quaternions, scalar_first=True).as_matrix())

    def placed(self, points: Floats, center_of_mass: ArrayLike, frame: int) -> Floats:
        """Positions (n, 3) in m of points (n, 3) of the body in a frame.

        points, center_of_mass: in the body's own frame and unit of length. They are scaled like the
        body, to the size of the table's die.
        """
        arms = (points - np.asarray(center_of_mass)) @ self.body.axes
        arms *= self.table.size / (2.0 * self.body.radius)
        return np.asarray(self.positions[frame] + arms @ self.rotations[frame].T)


def throw_film(body: RigidBody, table: Table, seed: int = 0, down: Floats | None = None) -> Film:
    """Film a typical throw, until the body is at rest to the eye.

    It is that of median length of `CANDIDATES` throws. A throw that has not come to rest in the
    time that simulations give it is given up there.

    seed: at least 0; the same gives the same film. down: (3,) unit direction of the body's own
    frame that is downward as it is let go; None for orientations at random.

    Raises InputError: the compiled kernels are missing.
    """
    contact = contact_of(table)
    rng = np.random.default_rng(seed)
    if down is None:
        states = released(body, table, np.arange(CANDIDATES), "uniform", rng)
    else:
        states = released_on(body, table, CANDIDATES, down, rng)
    _, steps = advance(body, table, states.copy(), round(contact.seconds / contact.step))
    state = states[[np.argsort(steps, kind="stable")[CANDIDATES // 2]]]
    # Whole steps to a frame.
    steps_per_frame = math.ceil(1.0 / (FRAMES_PER_SECOND * contact.step))
    refinement = steps_per_frame * FRAMES_PER_SECOND * contact.step
    # Engines stop where the end is certain, which is while the body still rocks.
    unstopped = replace(body, barriers=np.full_like(body.barriers, -np.inf))
    frames = [state[0].copy()]
    rest = -1
    while rest < 0 and len(frames) < contact.seconds * FRAMES_PER_SECOND:
        advance(unstopped, table, state, steps_per_frame, refinement)
        frames.append(state[0].copy())
        rest = _settled_rest(body, table, state[0])
    motion = np.array(frames)
    seconds = np.arange(len(motion)) / FRAMES_PER_SECOND
    return Film(body, table, seconds, motion[:, :3], motion[:, 3:7], rest)


def _settled_rest(body: RigidBody, table: Table, state: Floats) -> int:
    """The rest that a body in a state (13,) lies on, or -1 while it moves."""
    radius = table.size / 2.0
    speeds = np.linalg.norm(state[7:10]), radius * np.linalg.norm(state[10:])
    if max(speeds) > SETTLED * math.sqrt(GRAVITY * radius):
        return -1
    down = -Rotation.from_quat(state[3:7], scalar_first=True).as_matrix()[2]
    angles = angle_between(body.rest_normals, down)
    nearest = int(np.argmin(angles))
    return nearest if angles[nearest] <= STANDING_ANGLE else -1
