"""Simulators of throws by name, what they are told about contacts, and the package's own engine:
compiled throws of one convex hull onto one plane."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.throws.tables import most_of

if TYPE_CHECKING:
    from dicedesign.throws.rigid_body import RigidBody
    from dicedesign.throws.tables import Table


class ThrowStates(Protocol):
    """Throws of one body."""

    def __call__(
        self, body: RigidBody, table: Table, states: Floats, refinement: float = 1.0
    ) -> Integers:
        """The rests (n,) of bodies let go in states (n, 13), positions in m, quaternions w, x, y,
        z, velocities in m/s and spins in rad/s about the principal axes; -1 for those that found
        none in time. refinement: divides the time step."""


@dataclass(frozen=True, kw_only=True)
class Engine(Extension):
    """A simulator.

    Attributes
    ----------
    title: what tables call it.
    phrase: what sentences call it, if not so.
    require: raises InputError where it is not installed.
    throw_states: throws a body; may raise the same.
    """

    title: str
    phrase: str | None = None
    require: Callable[[], Any]
    throw_states: ThrowStates


ENGINES: Final = Registry(
    "engine",
    Engine,
    builtin=(
        "dicedesign.throws.engines:NATIVE",
        "dicedesign.throws.mujoco_engine:MUJOCO",
    ),
    group="dicedesign.engines",
)


def require_engine(name: str) -> Engine:
    """The engine of a name. Raises InputError where there is no such engine, or it is not
    installed."""
    engine = ENGINES[name]
    engine.require()
    return engine


GRAVITY: Final = 9.81
"""In m/s^2."""

DEEPEST: Final = 0.05
"""How far the fastest impact of a throw may push a vertex below the table, relative to the die's
radius. Halving it changes probabilities by less than sampling 40,000 drops does."""

STEPS_PER_CONTACT: Final = 8
"""Time steps of one bounce."""

IMPEDANCE: Final = 0.99
"""Of MuJoCo's soft contacts: the part of the acceleration asked of a contact that it gets; 1 is a
problem without a unique answer."""

SETTLING: Final = 400.0
"""How long a throw is followed after its bounces, in units of the square root of radius over
gravity: some 14 seconds for a die of 25 mm."""

LARGEST_RATIO: Final = 100.0
"""Damping ratio that stands for no restitution at all."""


@dataclass(frozen=True)
class Contact:
    """A contact for a body of mass 1, and the steps to simulate it with.

    Attributes
    ----------
    stiffness: 1/s^2, acceleration of a contact point over its depth.
    damping: 1/s, along the normal.
    sliding_damping: 1/s, of speed along the table, up to the limit of friction.
    step: seconds.
    seconds: after which a throw is given up.
    """

    stiffness: float
    damping: float
    sliding_damping: float
    step: float
    seconds: float


def contact_of(table: Table, refinement: float = 1.0, stiffness: float = 1.0) -> Contact:
    """Contact parameters of a table, shared by all its throws: stiff enough for the fastest.

    refinement: divides the time step, at the same contact. stiffness: multiplies that of the
    contact, and so many more time steps there are that a bounce has as many.
    """
    radius = table.size / 2.0
    height, speed, spin = (most_of(value) for value in (table.height, table.speed, table.spin))
    fastest = math.sqrt(2.0 * GRAVITY * (height + 2.0 * radius) + speed**2 + (spin * radius) ** 2)
    frequency = math.sqrt(stiffness) * fastest / (DEEPEST * radius)
    step = math.pi / frequency / STEPS_PER_CONTACT
    # More damping than would stop a point within one step makes it bounce again. So a restitution
    # below 0.1 is one that steps of this length cannot tell from 0.
    most = 1.0 / (2.0 * frequency * step)
    return Contact(
        stiffness=frequency**2,
        damping=2.0 * min(damping_ratio(table.restitution), most) * frequency,
        sliding_damping=2.0 * frequency,
        step=step / refinement,
        seconds=longest_throw(table),
    )


def longest_throw(table: Table) -> float:
    """Seconds after which a throw is given up: a ball would have come to lie, and `SETTLING` is for
    what a die does besides, as tumbling, sliding and rolling."""
    # A ball that falls for a time t bounces for 2 e t, then for 2 e^2 t and so on, where e is the
    # restitution: t (1 + e) / (1 - e) in all.
    fall = math.sqrt(2.0 * most_of(table.height) / GRAVITY)
    bouncing = fall * ((1.0 + table.restitution) / (1.0 - table.restitution))
    return bouncing + SETTLING * math.sqrt(table.size / 2.0 / GRAVITY)


def restitution_of(ratio: float) -> float:
    """Speed after over speed before a bounce off a spring with a damper of a damping ratio from 0,
    which the body leaves as soon as they would pull."""
    if ratio == 1.0:
        return math.exp(-2.0)
    root = math.sqrt(abs(1.0 - ratio**2))
    angle = 2.0 * math.acos(ratio) if ratio < 1.0 else 2.0 * math.acosh(ratio)
    return math.exp(-ratio / root * angle)


def damping_ratio(restitution: float) -> float:
    """The damping ratio that gives a restitution from 0 to below 1."""
    # Imported here, as reading a table does without.
    from scipy.optimize import brentq

    wanted = max(restitution, restitution_of(LARGEST_RATIO))
    ratio: float = brentq(lambda z: restitution_of(z) - wanted, 0.0, LARGEST_RATIO, xtol=1e-14)
    return ratio


MISSING: Final = (
    "engine native: expected the compiled kernels, but they were not built; install the package "
    "where there is a C++ compiler, or take the engine mujoco"
)


def require() -> None:
    """Raises InputError: the compiled kernels are missing."""
    if not kernels.available():
        raise InputError(MISSING)


def throw_states(
    body: RigidBody,
    table: Table,
    states: Floats,
    refinement: float = 1.0,
    stiffness: float = 1.0,
) -> Integers:
    """The rests (n,) of bodies let go in states (n, 13); -1 for those that found none in time.

    The equations of motion and of soft contact are those of MuJoCo, with the lowest eight of the
    vertices below the table in contact, and so are the time steps, but that free rotation keeps its
    angular momentum and energy. As long as no vertex can touch the table many steps are one. A
    throw ends as soon as its energy is below every saddle on the border of the basin that it is in:
    it can leave it no more. That is exact but for how deep a contact is at rest, some 1e-4 radii.
    It also ends as soon as its state is not finite.

    stiffness: as in `contact_of`.

    Raises InputError: the compiled kernels are missing.
    """
    contact = contact_of(table, refinement, stiffness)
    steps = round(contact.seconds / contact.step)
    outcome, _ = advance(body, table, states.copy(), steps, refinement, stiffness)
    return outcome


def advance(
    body: RigidBody,
    table: Table,
    states: Floats,
    steps: int,
    refinement: float = 1.0,
    stiffness: float = 1.0,
) -> tuple[Integers, Integers]:
    """Advance states (n, 13) in place by at most a number of time steps. Returns the rest that
    each cannot miss any more, or -1, and (n,) the steps taken."""
    contact = contact_of(table, refinement, stiffness)
    how = (
        contact.step,
        GRAVITY,
        table.drag,
        contact.stiffness,
        contact.damping,
        contact.sliding_damping,
        table.friction,
        IMPEDANCE,
    )
    scale = table.size / 2.0
    landscape = (
        body.vertices * scale,
        body.start,
        body.neighbors,
        body.left,
        body.right,
        body.normals,
        body.rest_of_facet,
        body.barriers * scale,
    )
    moments = body.moments * scale**2
    advanced = kernels.advance_throws(landscape, moments, np.array(how), states, steps)
    if advanced is None:
        raise InputError(MISSING)
    return advanced


NATIVE: Final = Engine(
    name="native",
    line="the package's own",
    title="native",
    phrase="the package's own engine",
    require=require,
    throw_states=throw_states,
)
