"""Impacts of one vertex of a body on the table, in every engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.meshes.body import make_body
from dicedesign.rest.poses import rest_poses
from dicedesign.throws.engines import advance, time_step
from dicedesign.throws.rigid_body import RigidBody, rigid_body
from dicedesign.throws.tables import GRAVITY, Table
from examples import mujoco_engine
from tests.reference.impacts import response_of

STRUCK = Table("struck", restitution=0.5, friction=0.5, height=0.5, speed=8.0, spin=0.0)
"""Table whose soft contacts are stiff enough for a slip of 8 m/s."""

APPROACH = 1.0
"""Normal speed before an impact, m/s."""

FINER = 16.0
"""Divisor of the time step of soft contacts."""

STIFFER = 4.0
"""Factor of the stiffness of soft contacts."""

LONGEST_CONTACT = 40.0
"""Of soft contacts, in their usual time steps, of which a bounce takes eight."""

INSTANT = 1e-5
"""Time step of hard contacts, relative to the usual one."""


def unstopped(body: RigidBody) -> RigidBody:
    """The body, whose throws do not end."""
    return replace(body, barriers=np.full_like(body.barriers, -np.inf))


@dataclass(frozen=True)
class Strike:
    """Impact of a vertex that moves like the center of mass, of a body without spin.

    Attributes
    ----------
    vertex: of the body. turn: from principal axes to the world.
    slip: (2,) along the table, m/s.
    """

    body: RigidBody
    vertex: int
    turn: Rotation
    slip: np.ndarray
    restitution: float
    friction: float

    @cached_property
    def table(self) -> Table:
        """Table of the impact."""
        return replace(STRUCK, restitution=self.restitution, friction=self.friction)

    @cached_property
    def scale(self) -> float:
        """Radius of the body in m."""
        return self.table.size / 2.0

    @cached_property
    def velocity(self) -> np.ndarray:
        """(3,) of the vertex before the impact, m/s."""
        return np.array([*self.slip, -APPROACH])

    @cached_property
    def response(self) -> np.ndarray:
        """(3, 3) change of the vertex's velocity per impulse."""
        moments, vertex = self.body.moments * self.scale**2, self.body.vertices[self.vertex]
        return response_of(vertex * self.scale, moments, self.turn.as_matrix())

    @cached_property
    def state(self) -> np.ndarray:
        """(13,) before the impact, with the vertex on the table."""
        height = -self.scale * self.turn.apply(self.body.vertices[self.vertex])[2]
        turn = self.turn.as_quat(scalar_first=True)
        return np.array([0.0, 0.0, height, *turn, *self.velocity, 0.0, 0.0, 0.0])

    def height_after(self, state: np.ndarray) -> float:
        """Height of the vertex in a state (13,)."""
        turn = Rotation.from_quat(state[3:7], scalar_first=True)
        vertex = turn.apply(self.body.vertices[self.vertex])
        return float(state[2] + self.scale * vertex[2])

    def impulse(self, state: np.ndarray, seconds: float) -> np.ndarray:
        """(3,) from the state some time after the impact began."""
        gained: np.ndarray = state[7:10] - self.velocity + [0.0, 0.0, GRAVITY * seconds]
        return gained


def strike_natively(strike: Strike) -> np.ndarray:
    """Impulse (3,) in the engine native."""
    state = strike.state[None].copy()
    advance(unstopped(strike.body), strike.table, state, 1, 1.0 / INSTANT)
    return strike.impulse(state[0], time_step(strike.table, 1.0 / INSTANT))


def strike_in_mujoco(strike: Strike) -> np.ndarray:
    """Impulse (3,) in MuJoCo. Raises InputError if it is not installed."""
    mujoco = mujoco_engine.require()
    usual, faster = mujoco_engine.contact_of(strike.table), math.sqrt(STIFFER)
    contact = mujoco_engine.Contact(
        stiffness=STIFFER * usual.stiffness,
        damping=faster * usual.damping,
        sliding_damping=faster * usual.sliding_damping,
        step=usual.step / faster / FINER,
    )
    scene = mujoco_engine.scene_of(strike.body, strike.table, contact)
    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = strike.state[:7], strike.state[7:]
    steps = 0
    while steps < FINER * LONGEST_CONTACT:
        steps += 1
        mujoco.mj_step(model, data)
        state = np.concatenate([data.qpos, data.qvel])
        if strike.height_after(state) > 0.0:
            break
    return strike.impulse(state, steps * contact.step)


STRIKES: dict[str, Callable[[Strike], np.ndarray]] = {
    "native": strike_natively,
    "mujoco": strike_in_mujoco,
}
"""Impulses of impacts, by the names of engines."""


def faceted_ball() -> tuple[RigidBody, int]:
    """Ball of 162 vertices, and one of them."""
    # Imported late, like in the package.
    import trimesh

    return _body(trimesh.creation.icosphere(subdivisions=2).vertices), 0


def needle() -> tuple[RigidBody, int]:
    """Thin double pyramid, and the vertex at one end."""
    girdle = 0.05 * np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    body = _body(np.concatenate([[(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)], girdle, -girdle]))
    return body, int(np.argmax(np.linalg.norm(body.vertices, axis=1)))


def _body(points: np.ndarray) -> RigidBody:
    body = make_body(points)
    return rigid_body(body, rest_poses(body))


def lean(body: RigidBody, vertex: int, angle: float) -> Rotation:
    """Turn after which the arm of a vertex leans by an angle from straight down towards +x."""
    arm = np.array([[np.sin(angle), 0.0, -np.cos(angle)]])
    direction = body.vertices[vertex] / np.linalg.norm(body.vertices[vertex])
    turn: Rotation = Rotation.align_vectors(arm, direction[None])[0]
    return turn
