"""An engine of one's own: throws in Bullet, whose contacts are hard, impulses with a coefficient of
restitution. It needs `pip install pybullet`, which is compiled where there is no wheel of it.

Bullet has thresholds in absolute units, made for bodies of a meter. So it is told of a die in units
of its radius and of the time in which a body falls by half of that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

import dicedesign as dd
from dicedesign.geometry.sphere import angle_between
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines import ENGINES, GRAVITY, Engine, longest_throw
from dicedesign.throws.mujoco_engine import final_rest
from dicedesign.tolerances import STANDING_ANGLE

if TYPE_CHECKING:
    from dicedesign.throws.rigid_body import RigidBody
    from dicedesign.throws.tables import Table

STEP: Final = 1.0 / 128.0
"""Of time, in units of the square root of radius over gravity. Halving it changes probabilities by
less than sampling 6,000 drops does."""

STEPS_PER_CHECK: Final = 16

TOUCHING: Final = 1e-4
"""Distance in radii at which points are in contact. Of a point that comes nearer within a step
Bullet stops part of the speed before it bounces: this over the step, which is a hundredth of the
square root of radius times gravity. Its own 0.02 would stop slow ones altogether."""

MARGIN: Final = 1e-5
"""By which Bullet rounds the hull, in radii."""

STANDING_SPEED: Final = 1e-2
"""Bodies whose speed stays below this are at a stand; in units of the square root of radius times
gravity, and by so much less as drag makes them fall more slowly."""

STANDING_TIME: Final = 10.0
"""How long they do, in units of the square root of radius over gravity, and by so much longer as
drag makes it fall more slowly: one that balances on an edge would have fallen off."""


def require() -> ModuleType:
    """PyBullet. Raises InputError: it is not installed."""
    try:
        import pybullet
    except ImportError as error:
        raise dd.InputError(
            f"engine bullet: expected PyBullet, but {error}; pip install pybullet"
        ) from error
    found: ModuleType = pybullet
    return found


def throw_states(
    body: RigidBody, table: Table, states: Floats, refinement: float = 1.0
) -> Integers:
    """The rests (n,) of bodies let go in states (n, 13), see `ThrowStates`.

    A body that comes to a stand with more energy than it needs to leave its basin, as Bullet's may
    on an edge, ends at the rest whose normal is within `STANDING_ANGLE` of down, or at none.

    Raises InputError: PyBullet is not installed.
    """
    length = table.size / 2.0
    time = math.sqrt(length / GRAVITY)
    step = STEP / refinement
    steps = math.ceil(longest_throw(table) / time / step)
    # Of torque over angular velocity, as the other engines have it.
    kept = 1.0 / (1.0 + step * time * table.drag * body.moments.mean() / body.moments)
    with _scene(body, table, step) as scene:
        outcomes = []
        for state in states:
            scene.release(
                state[:3] / length, state[3:7], state[7:10] * time / length, state[10:] * time
            )
            outcomes.append(scene.outcome(steps, kept if table.drag > 0.0 else None))
    return np.array(outcomes, dtype=np.int64)


@contextmanager
def _scene(body: RigidBody, table: Table, step: float) -> Iterator[_Scene]:
    """A table and a die in a world of their own."""
    pybullet = require()
    client = pybullet.connect(pybullet.DIRECT)
    try:
        yield _Scene(pybullet, client, body, table, step)
    finally:
        pybullet.disconnect(client)


class _Scene:
    """A table and a die in the world of one Bullet client."""

    def __init__(
        self, bullet: Any, client: int, body: RigidBody, table: Table, step: float
    ) -> None:
        self._bullet, self._body, self._step = bullet, body, step
        slower = 1.0 + table.drag * math.sqrt(table.size / 2.0 / GRAVITY)
        self._slow, self._patience = STANDING_SPEED / slower, STANDING_TIME * slower
        self._client = {"physicsClientId": client}
        bullet.setGravity(0.0, 0.0, -1.0, **self._client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=step,
            contactBreakingThreshold=TOUCHING,
            restitutionVelocityThreshold=0.0,
            # Overlaps are mended without giving the body any speed.
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
        # Not as the base of a chain of links, which is the default.
        placed: int = bullet.createMultiBody(
            mass, shape, useMaximalCoordinates=True, **self._client
        )
        # Without a mass it would lose the one it has.
        bullet.changeDynamics(
            placed,
            -1,
            mass=mass,
            rollingFriction=0.0,
            spinningFriction=0.0,
            **dynamics,
            **self._client,
        )
        return placed

    def release(self, position: Floats, turn: Floats, velocity: Floats, spin: Floats) -> None:
        """Put the die somewhere; turn: quaternion w, x, y, z; spin: about its own axes."""
        bullet = self._bullet
        turn = np.roll(turn, -1)
        bullet.resetBasePositionAndOrientation(self._die, position, turn, **self._client)
        bullet.resetBaseVelocity(self._die, velocity, _axes(turn) @ spin, **self._client)

    def outcome(self, steps: int, kept: Floats | None) -> int:
        """The rest at which the die ends within so many steps, or -1; kept: as for `advance`."""
        stood = 0
        for _ in range(0, steps, STEPS_PER_CHECK):
            self.advance(STEPS_PER_CHECK, kept)
            down, energy, speed = self.state()
            rest = final_rest(self._body, down, energy)
            if rest >= 0:
                return rest
            stood = stood + STEPS_PER_CHECK if speed < self._slow else 0
            if stood * self._step > self._patience:
                return self._standing(down)
        return -1

    def advance(self, steps: int, kept: Floats | None) -> None:
        """Take so many steps; kept: (3,) part of the angular velocity about each axis of the die
        that drag leaves in one, None for all."""
        bullet = self._bullet
        for _ in range(steps):
            bullet.stepSimulation(**self._client)
            if kept is None:
                continue
            velocity, spin = bullet.getBaseVelocity(self._die, **self._client)
            axes = self.turn()
            braked = axes @ (kept * (spin @ axes))
            bullet.resetBaseVelocity(self._die, velocity, braked, **self._client)

    def turn(self) -> Floats:
        """The die's axes as columns (3, 3), in the world."""
        _, quaternion = self._bullet.getBasePositionAndOrientation(self._die, **self._client)
        return _axes(quaternion)

    def spin(self) -> Floats:
        """Angular velocity (3,) about the die's axes."""
        _, spin = self._bullet.getBaseVelocity(self._die, **self._client)
        about: Floats = spin @ self.turn()
        return about

    def state(self) -> tuple[Floats, float, float]:
        """Direction down in the die's frame, the height to which its energy would lift it, and its
        speed, that of its center together with that of its surface."""
        position, _ = self._bullet.getBasePositionAndOrientation(self._die, **self._client)
        velocity, _ = self._bullet.getBaseVelocity(self._die, **self._client)
        spin = self.spin()
        squared = float(np.dot(velocity, velocity))
        energy = position[2] + 0.5 * (squared + float(self._body.moments @ spin**2))
        return -self.turn()[2], energy, math.sqrt(squared + float(spin @ spin))

    def _standing(self, down: Floats) -> int:
        """The rest that the die stands on, or -1."""
        angles = angle_between(self._body.rest_normals, down)
        nearest = int(angles.argmin())
        return nearest if angles[nearest] < STANDING_ANGLE else -1


def _axes(turn: Any) -> Floats:
    """The matrix (3, 3) of a quaternion x, y, z, w."""
    x, y, z, w = turn
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


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
