"""Add an engine of throws: the die falls onto the rest that is nearest to down.

An engine gets a `RigidBody` of radius 1, a `Table`, and states (n, 13): position (m), quaternion
w, x, y, z, velocity (m/s) and spin (rad/s, about the principal axes). It returns the number of
the rest for each, or -1 if the body did not come to rest in time. All chance is in `states`, so
one seed gives one result. `require` raises `InputError` if the engine is not installed. A complete
one: mujoco_engine.py.
"""

import numpy as np

import dicedesign as dd
from dicedesign.extensions import ENGINES, Engine


def throw_states(body, table, states):
    w, x, y, z = states[:, 3:7].T
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    return (-up @ body.rest_normals.T).argmax(axis=1)


ENGINES.register(
    Engine(
        name="nearest",
        line="falls onto the rest that is nearest to down",
        title="nearest",
        require=lambda: None,
        throw_states=throw_states,
    )
)

mesh = dd.read_body("outputs/2d6_hendecahedron/die.stl")
poses = dd.rest_poses(mesh)
table = dd.load_table("board-game")
throws = dd.simulate(dd.rigid_body(mesh, poses), table, drops=1000, engine="nearest")
print(poses.probabilities)
print(throws.frequencies)
