"""Add an engine: throws in Bullet, with hard contacts and a coefficient of restitution.

It needs `pip install pybullet`, which compiles Bullet on systems without a wheel. Bullet's
thresholds are made for bodies of a meter. So the unit of length is the radius of the die, and the
unit of time is the square root of radius over gravity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

import dicedesign as dd
from dicedesign.extensions import ENGINES, GRAVITY, Engine, RigidBody, final_rest, longest_throw

STEP: Final = 1.0 / 128.0
"""Time step. Half of it changes probabilities by less than the noise of 6,000 throws."""

STEPS_PER_CHECK: Final = 16

CONTACT_DISTANCE: Final = 1e-4
"""Distance of points in contact. A point that comes nearer within a step loses a speed of this
distance over the step before it bounces. Bullet's default of 0.02 would stop slow points."""

MARGIN: Final = 1e-5
"""Radius of the rounded edges of the hull."""

STANDING_COSINE: Final = math.cos(math.radians(1.0))
"""A body that stands still rests on a facet whose normal is within one degree of down."""

STANDING_SPEED: Final = 1e-2
"""A body below this speed stands still; drag lowers the limit like the falling speed."""

STANDING_TIME: Final = 10.0
"""Time that a body stands still before its throw ends. A body on an edge falls over in less; drag
raises the limit like the falling time."""


def require() -> ModuleType:
    """Import PyBullet. Raises InputError: it is not installed."""
    try:
        import pybullet
    except ImportError as error:
        raise dd.InputError(
            f"engine bullet: expected PyBullet, but {error}; pip install pybullet"
        ) from error
    module: ModuleType = pybullet
    return module


def throw_states(body: RigidBody, table: dd.Table, states: np.ndarray) -> np.ndarray:
    """Final rests (n,) of throws from states (n, 13), see add_engine.py; -1 without a rest.

    A body that stands still with enough energy to leave its basin ends at the rest whose normal is
    within one degree of down, if there is one.

    Raises InputError: PyBullet is not installed.
    """
    length = table.size / 2.0
    time = math.sqrt(length / GRAVITY)
    steps = math.ceil(longest_throw(table) / time / STEP)
    # The drag torque is proportional to the angular velocity, as in the other engines.
    damping = 1.0 / (1.0 + STEP * time * table.drag * body.moments.mean() / body.moments)
    with _scene(body, table) as scene:
        outcomes = []
        for state in states:
            scene.release(
                state[:3] / length, state[3:7], state[7:10] * time / length, state[10:] * time
            )
            outcomes.append(scene.outcome(steps, damping if table.drag > 0.0 else None))
    return np.array(outcomes, dtype=np.int64)


@contextmanager
def _scene(body: RigidBody, table: dd.Table) -> Iterator[_Scene]:
    """Create and close a Bullet world with a table and a die."""
    pybullet = require()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        yield _Scene(pybullet, client, body, table)
    finally:
        pybullet.disconnect(client)


class _Scene:
    """Table and die in the world of a Bullet client."""

    def __init__(self, bullet: Any, client: int, body: RigidBody, table: dd.Table) -> None:
        self._bullet, self._body = bullet, body
        drag_factor = 1.0 + table.drag * math.sqrt(table.size / 2.0 / GRAVITY)
        self._slow, self._patience = STANDING_SPEED / drag_factor, STANDING_TIME * drag_factor
        self._client = {"physicsClientId": client}
        bullet.setGravity(0.0, 0.0, -1.0, **self._client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP,
            contactBreakingThreshold=CONTACT_DISTANCE,
            restitutionVelocityThreshold=0.0,
            # Resolve overlaps without adding speed.
            useSplitImpulse=1,
            splitImpulsePenetrationThreshold=0.0,
            deterministicOverlappingPairs=1,
            **self._client,
        )
        plane = bullet.createCollisionShape(bullet.GEOM_PLANE, **self._client)
        self._place(plane, 0.0, restitution=1.0, lateralFriction=1.0)
        hull = bullet.createCollisionShape(
            bullet.GEOM_MESH, vertices=body.vertices.tolist(), **self._client
        )
        # Bullet multiplies the two bodies' coefficients, and takes the moments of the hull's box.
        self._die = self._place(
            hull,
            1.0,
            localInertiaDiagonal=body.moments.tolist(),
            restitution=table.restitution,
            lateralFriction=table.friction,
            linearDamping=0.0,
            angularDamping=0.0,
            collisionMargin=MARGIN,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        )

    def _place(self, shape: int, mass: float, **dynamics: Any) -> int:
        bullet = self._bullet
        # The default is the base of a chain of links.
        identifier: int = bullet.createMultiBody(
            mass, shape, useMaximalCoordinates=True, **self._client
        )
        # `changeDynamics` without a mass removes it.
        bullet.changeDynamics(
            identifier,
            -1,
            mass=mass,
            rollingFriction=0.0,
            spinningFriction=0.0,
            **dynamics,
            **self._client,
        )
        return identifier

    def release(
        self, position: np.ndarray, turn: np.ndarray, velocity: np.ndarray, spin: np.ndarray
    ) -> None:
        """Release the die. turn: quaternion w, x, y, z; spin: (3,) about the axes of the die."""
        bullet = self._bullet
        turn = np.roll(turn, -1)
        bullet.resetBasePositionAndOrientation(self._die, position, turn, **self._client)
        bullet.resetBaseVelocity(self._die, velocity, _axes(turn) @ spin, **self._client)

    def outcome(self, steps: int, damping: np.ndarray | None) -> int:
        """Rest of the die after at most a number of steps, or -1. damping: as in `advance`."""
        standing_steps = 0
        for _ in range(0, steps, STEPS_PER_CHECK):
            self.advance(STEPS_PER_CHECK, damping)
            down, energy, speed = self.state()
            rest = final_rest(self._body, down, energy)
            if rest >= 0:
                return rest
            standing_steps = standing_steps + STEPS_PER_CHECK if speed < self._slow else 0
            if standing_steps * STEP > self._patience:
                cosines = self._body.rest_normals @ down
                nearest = int(cosines.argmax())
                return nearest if cosines[nearest] > STANDING_COSINE else -1
        return -1

    def advance(self, steps: int, damping: np.ndarray | None) -> None:
        """Advance by a number of steps.

        damping: (3,) factor per step on the angular velocity about each axis of the die, or None.
        """
        bullet = self._bullet
        for _ in range(steps):
            bullet.stepSimulation(**self._client)
            if damping is None:
                continue
            velocity, spin = bullet.getBaseVelocity(self._die, **self._client)
            axes = self.turn()
            damped = axes @ (damping * (spin @ axes))
            bullet.resetBaseVelocity(self._die, velocity, damped, **self._client)

    def turn(self) -> np.ndarray:
        """Axes of the die in the world, as columns (3, 3)."""
        _, quaternion = self._bullet.getBasePositionAndOrientation(self._die, **self._client)
        return _axes(quaternion)

    def state(self) -> tuple[np.ndarray, float, float]:
        """Direction down (3,) in the frame of the die, energy as a height, and speed.

        The speed combines the velocity of the center with the velocity of the surface.
        """
        position, _ = self._bullet.getBasePositionAndOrientation(self._die, **self._client)
        velocity, spin = self._bullet.getBaseVelocity(self._die, **self._client)
        axes = self.turn()
        spin = spin @ axes
        squared = float(np.dot(velocity, velocity))
        energy = position[2] + 0.5 * (squared + float(self._body.moments @ spin**2))
        return -axes[2], energy, math.sqrt(squared + float(spin @ spin))


def _axes(turn: Any) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion x, y, z, w."""
    return np.asarray(Rotation.from_quat(turn).as_matrix())


ENGINES.register(
    Engine(
        name="bullet",
        line="Bullet, which needs PyBullet",
        title="Bullet",
        require=require,
        throw_states=throw_states,
    )
)

if __name__ == "__main__":
    corners = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.15) for z in (0.0, 1.3)]
    mesh = dd.make_body(np.array(corners))
    poses = dd.rest_poses(mesh)
    body = dd.rigid_body(mesh, poses)
    table = dd.load_table("board-game")
    for name in ("native", "bullet"):
        throws = dd.simulate(body, table, drops=200, engine=name)
        print(f"{name:7}", throws.frequencies.round(3))
