"""Add the simulator of another library as an engine: throws in MuJoCo.

It needs `pip install mujoco`. MuJoCo's contacts are soft. Stiffness and damping are chosen for a
table's restitution in a bounce without slip. With slip its cone of friction couples the directions,
so that restitution and friction are other ones: `python -m benchmarks thrown --part contacts`
prints by how much. A throw ends as soon as its energy is below every saddle around its basin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import dicedesign as dd
from dicedesign.extensions import ENGINES, GRAVITY, Engine, RigidBody, longest_throw

DEEPEST: Final = 0.05
"""Largest depth of a vertex below the table in the fastest impact of a throw, relative to the die's
radius."""

STEPS_PER_CONTACT: Final = 8
"""Number of time steps of one bounce."""

STEPS_PER_CHECK: Final = 32
"""Number of time steps after which the energy is compared with the saddles."""

STEPS_IN_FLIGHT: Final = 4
"""Time steps that replace `STEPS_PER_CHECK` while a die cannot touch the table. At the fastest spin
of a throw's energy, each Runge-Kutta step turns the die by 0.2 rad, and the energy of the spin
changes by less than 1e-5 in a second."""

IMPEDANCE: Final = 0.99
"""Share of the requested contact acceleration that MuJoCo's soft contacts realize; 1 has no unique
solution."""

MAX_DAMPING_RATIO: Final = 100.0
"""Damping ratio for a restitution of 0."""


@dataclass(frozen=True)
class Contact:
    """Parameters of soft contacts of a body of mass 1.

    Attributes
    ----------
    stiffness: acceleration of a contact point per depth, 1/s^2.
    damping: along the normal, 1/s.
    sliding_damping: of speed along the table, up to the limit of friction, 1/s.
    step: time step in seconds.
    """

    stiffness: float
    damping: float
    sliding_damping: float
    step: float


def contact_of(table: dd.Table) -> Contact:
    """Contact parameters of a table: stiff enough for its fastest throw."""
    radius = table.size / 2.0
    # Each may be a range.
    height, speed, spin = (float(np.max(x)) for x in (table.height, table.speed, table.spin))
    fastest = math.sqrt(2.0 * GRAVITY * (height + 2.0 * radius) + speed**2 + (spin * radius) ** 2)
    frequency = fastest / (DEEPEST * radius)
    step = math.pi / frequency / STEPS_PER_CONTACT
    # More damping than stops a point within one step makes it bounce again. So steps of this length
    # do not distinguish a restitution below 0.1 from 0.
    most = 1.0 / (2.0 * frequency * step)
    return Contact(
        stiffness=frequency**2,
        damping=2.0 * min(damping_ratio(table.restitution), most) * frequency,
        sliding_damping=2.0 * frequency,
        step=step,
    )


def damping_ratio(restitution: float) -> float:
    """Damping ratio of a spring and damper for a restitution in [0, 1)."""
    target = max(restitution, restitution_of(MAX_DAMPING_RATIO))
    return float(brentq(lambda z: restitution_of(z) - target, 0.0, MAX_DAMPING_RATIO, xtol=1e-14))


def restitution_of(ratio: float) -> float:
    """Ratio of speeds after and before a bounce off a spring and damper with a damping ratio of at
    least 0, which the body leaves as soon as they would pull."""
    if ratio == 1.0:
        return math.exp(-2.0)
    root = math.sqrt(abs(1.0 - ratio**2))
    angle = 2.0 * math.acos(ratio) if ratio < 1.0 else 2.0 * math.acosh(ratio)
    return math.exp(-ratio / root * angle)


def rest_below(body: RigidBody, down: np.ndarray) -> int:
    """Rest in whose basin a direction is; -1 if rounding hides the path to it.

    down: (3,) unit vector that points down, in the frame of the principal axes. The path without
    momentum is followed: away from the lowest vertex, over ridges into the next cell, or along
    hinges to a facet.
    """
    vertices = body.vertices
    p = int(np.argmax(vertices @ down))
    for _ in range(len(vertices)):
        edges = slice(body.start[p], body.start[p + 1])
        neighbors = body.neighbors[edges]
        v = vertices[p] - vertices[neighbors]
        approach = v @ vertices[p]
        ahead = np.flatnonzero(approach > 0.0)
        if len(ahead) == 0:
            return -1
        when = (v[ahead] @ down) / approach[ahead]
        soonest = int(np.argmin(when))
        down = down - max(float(when[soonest]), 0.0) * vertices[p]
        down = down / np.linalg.norm(down)
        exit_edge = int(ahead[soonest])
        q, across = int(neighbors[exit_edge]), v[exit_edge]
        if across @ vertices[q] >= 0.0:
            p = q
            continue
        foot = vertices[p] - (vertices[p] @ across) / (across @ across) * across
        left, right = int(body.left[edges][exit_edge]), int(body.right[edges][exit_edge])
        to_left = (down @ foot * down - foot) @ (body.normals[left] - body.normals[right])
        return int(body.rest_of_facet[left if to_left > 0.0 else right])
    return -1


def final_rest(body: RigidBody, down: np.ndarray, energy: float) -> int:
    """Certain rest of a moving body, or -1: it cannot leave a basin if its energy is below every
    saddle on the border.

    down: see `rest_below`; energy: total energy, as the height in radii to which it would lift the
    center of mass.
    """
    if energy >= body.barriers.max():
        return -1
    rest = rest_below(body, down)
    return rest if rest >= 0 and energy < body.barriers[rest] else -1


SCENE: Final = """<mujoco>
<compiler boundmass="0" boundinertia="0" inertiafromgeom="false"/>
<option timestep="{step}" gravity="0 0 {gravity}" cone="elliptic" tolerance="1e-12"
 integrator="{integrator}"/>
<asset><mesh name="hull" vertex="{vertices}"/></asset>
<worldbody><geom name="table" type="plane" size="1 1 1"/>
<body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{moments}"/>
<geom name="die" type="mesh" mesh="hull" mass="0"/></body></worldbody>
<contact><pair geom1="table" geom2="die" condim="{rows}" friction="{friction} {friction}"
 solref="{stiffness} {damping}" solreffriction="-1 {sliding}" solimp="{impedance} {impedance}"/>
</contact></mujoco>"""
"""MuJoCo scene. The inertia is given, so it does not matter that MuJoCo turns the mesh into the
principal frame of its hull: it turns it back within the body. Negative numbers of `solref` are
stiffness and damping of the contact."""


def scene_of(body: RigidBody, table: dd.Table, contact: Contact) -> str:
    """MuJoCo scene of a body on a table."""
    scale = table.size / 2.0
    return SCENE.format(
        step=contact.step,
        # Euler's steps handle drag best, but change the energy of a fast spin.
        integrator="Euler" if table.drag > 0.0 else "RK4",
        gravity=-GRAVITY,
        vertices=_format_numbers((body.vertices * scale).ravel()),
        moments=_format_numbers(body.moments * scale**2),
        rows=3 if table.friction > 0.0 else 1,
        friction=table.friction,
        stiffness=-contact.stiffness,
        damping=-contact.damping,
        sliding=-contact.sliding_damping,
        impedance=IMPEDANCE,
    )


def _format_numbers(numbers: np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in numbers)


def require() -> ModuleType:
    """Module of MuJoCo. Raises InputError if it is not installed."""
    try:
        import mujoco
    except ImportError as error:
        raise dd.InputError(
            f"engine mujoco: expected MuJoCo, but {error}; pip install mujoco"
        ) from error
    module: ModuleType = mujoco
    return module


def throw_states(body: RigidBody, table: dd.Table, states: np.ndarray) -> np.ndarray:
    """Final rests (n,) of throws released in states (n, 13), see add_engine.py; -1 without a rest
    in time.

    Raises InputError if MuJoCo is not installed.
    """
    mujoco = require()
    contact = contact_of(table)
    model = mujoco.MjModel.from_xml_string(scene_of(body, table, contact))
    # Drag of the spin alone: drag of the fall would only delay the rest.
    scale = table.size / 2.0
    model.dof_damping[3:6] = table.drag * scale**2 * body.moments.mean()
    data = mujoco.MjData(model)
    steps, seconds = round(longest_throw(table) / contact.step), STEPS_PER_CHECK * contact.step
    outcome = np.full(len(states), -1, dtype=np.int64)
    for i, state in enumerate(states):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[:7], state[7:]
        for _ in range(0, steps, STEPS_PER_CHECK):
            rise = min(data.qvel[2] * seconds - 0.5 * GRAVITY * seconds**2, 0.0)
            count = STEPS_IN_FLIGHT if data.qpos[2] + rise > scale else STEPS_PER_CHECK
            model.opt.timestep = seconds / count
            mujoco.mj_step(model, data, count)
            velocity, spin = data.qvel[:3], scale * data.qvel[3:]
            moving = velocity @ velocity + spin**2 @ body.moments
            least = data.qpos[2] + 0.5 * moving / GRAVITY
            if least < scale * body.barriers.max():
                up = Rotation.from_quat(data.qpos[3:], scalar_first=True).inv().apply([0, 0, 1])
                depths = np.minimum(data.qpos[2] + scale * (body.vertices @ up), 0.0)
                stored = 0.5 * contact.stiffness * float(depths @ depths) / GRAVITY
                outcome[i] = final_rest(body, -up, (least + stored) / scale)
                if outcome[i] >= 0:
                    break
    return outcome


MUJOCO: Final = Engine(
    name="mujoco",
    line="MuJoCo",
    title="MuJoCo",
    require=require,
    throw_states=throw_states,
)

if __name__ == "__main__":
    ENGINES.register(MUJOCO)
    corners = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.15) for z in (0.0, 1.3)])
    body = dd.rigid_body(corners)
    for engine in ENGINES:
        try:
            throws = dd.simulate(body, dd.load_table("board-game"), drops=200, engine=engine.name)
            print(f"{engine.name:7}", throws.frequencies.round(3))
        except dd.InputError as error:
            print(error)
