"""Simulators of throws, their contact parameters, and the package's own engine: compiled throws of
one convex hull onto one plane."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

import numpy as np

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.throws.tables import most_of

if TYPE_CHECKING:
    from dicedesign.throws.rigid_body import RigidBody
    from dicedesign.throws.tables import Table


ThrowStates: TypeAlias = "Callable[[RigidBody, Table, Floats], Integers]"
"""Function from a body, a table and release states (n, 13) to final rests (n,). States are
positions in m, quaternions w, x, y, z, velocities in m/s and spins in rad/s about the principal
axes; the rest is -1 for throws that did not come to rest in time."""


@dataclass(frozen=True, kw_only=True)
class Engine(Extension):
    """A simulator.

    Attributes
    ----------
    title: name in tables.
    phrase: name in sentences, if another.
    require: raises InputError if the simulator is not installed.
    throw_states: throws a body; may raise InputError, too.
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
        "dicedesign.throws.impulse_engine:IMPULSES",
        "dicedesign.throws.mujoco_engine:MUJOCO",
    ),
    group="dicedesign.engines",
)


def require_engine(name: str) -> Engine:
    """Engine of a name. Raises InputError if there is none, or it is not installed."""
    engine = ENGINES[name]
    engine.require()
    return engine


GRAVITY: Final = 9.81
"""Acceleration in m/s^2."""

DEEPEST: Final = 0.05
"""Largest depth of a vertex below the table in the fastest impact of a throw, relative to the die's
radius. Halving it changes probabilities by less than the sampling error of 40,000 drops."""

STEPS_PER_CONTACT: Final = 8
"""Number of time steps of one bounce."""

IMPEDANCE: Final = 0.99
"""Share of the requested contact acceleration that MuJoCo's soft contacts realize; 1 has no unique
solution."""

SETTLING: Final = 400.0
"""Time after the bounces until a throw is given up, in units of the square root of radius over
gravity: about 14 seconds for a die of 25 mm."""

LARGEST_RATIO: Final = 100.0
"""Damping ratio for a restitution of 0."""


@dataclass(frozen=True)
class Contact:
    """Contact parameters of a body of mass 1, and time steps of the simulation.

    Attributes
    ----------
    stiffness: acceleration of a contact point per depth, 1/s^2.
    damping: along the normal, 1/s.
    sliding_damping: of speed along the table, up to the limit of friction, 1/s.
    step: time step in seconds.
    seconds: time after which a throw is given up.
    """

    stiffness: float
    damping: float
    sliding_damping: float
    step: float
    seconds: float


def contact_of(table: Table, refinement: float = 1.0, stiffness: float = 1.0) -> Contact:
    """Contact parameters of a table: stiff enough for its fastest throw.

    refinement: divisor of the time step. stiffness: factor of the contact's stiffness; a bounce
    takes equally many steps.
    """
    radius = table.size / 2.0
    height, speed, spin = (most_of(value) for value in (table.height, table.speed, table.spin))
    fastest = math.sqrt(2.0 * GRAVITY * (height + 2.0 * radius) + speed**2 + (spin * radius) ** 2)
    frequency = math.sqrt(stiffness) * fastest / (DEEPEST * radius)
    step = math.pi / frequency / STEPS_PER_CONTACT
    # More damping than stops a point within one step makes it bounce again. So steps of this length
    # do not distinguish a restitution below 0.1 from 0.
    most = 1.0 / (2.0 * frequency * step)
    return Contact(
        stiffness=frequency**2,
        damping=2.0 * min(damping_ratio(table.restitution), most) * frequency,
        sliding_damping=2.0 * frequency,
        step=step / refinement,
        seconds=longest_throw(table),
    )


def longest_throw(table: Table) -> float:
    """Seconds after which a throw is given up: the time until a bouncing ball is at rest, plus
    `SETTLING` for tumbling, sliding and rolling."""
    # A ball that falls for a time t bounces for 2 e t, then for 2 e^2 t and so on, with restitution
    # e: t (1 + e) / (1 - e) in total.
    fall = math.sqrt(2.0 * most_of(table.height) / GRAVITY)
    bouncing = fall * ((1.0 + table.restitution) / (1.0 - table.restitution))
    return bouncing + SETTLING * math.sqrt(table.size / 2.0 / GRAVITY)


def restitution_of(ratio: float) -> float:
    """Ratio of speeds after and before a bounce off a spring and damper with a damping ratio of at
    least 0, which the body leaves as soon as they would pull."""
    if ratio == 1.0:
        return math.exp(-2.0)
    root = math.sqrt(abs(1.0 - ratio**2))
    angle = 2.0 * math.acos(ratio) if ratio < 1.0 else 2.0 * math.acosh(ratio)
    return math.exp(-ratio / root * angle)


def damping_ratio(restitution: float) -> float:
    """Damping ratio for a restitution in [0, 1)."""
    # Imported late: reading a table does not need it.
    from scipy.optimize import brentq

    wanted = max(restitution, restitution_of(LARGEST_RATIO))
    ratio: float = brentq(lambda z: restitution_of(z) - wanted, 0.0, LARGEST_RATIO, xtol=1e-14)
    return ratio


MISSING: Final = (
    "engines native and impulses: expected the compiled kernels, but they were not built; install "
    "the package where there is a C++ compiler, or take the engine mujoco"
)


def require() -> None:
    """Raise InputError if the compiled kernels are missing."""
    if not kernels.available():
        raise InputError(MISSING)


def throw_states(
    body: RigidBody,
    table: Table,
    states: Floats,
    refinement: float = 1.0,
    stiffness: float = 1.0,
) -> Integers:
    """Final rests (n,) of throws released in states (n, 13); -1 without a rest in time.

    Equations of motion, soft contacts and time steps are MuJoCo's, with contacts at the lowest
    eight of the vertices below the table, except that free rotation conserves angular momentum and
    energy. Steps are merged while no vertex can touch the table. A throw ends as soon as its energy
    is below every saddle on the border of its basin, which it cannot leave then; this is exact up
    to the depth of a contact at rest, about 1e-4 radii. A throw also ends if its state is not
    finite.

    refinement, stiffness: see `contact_of`.

    Raises InputError if the compiled kernels are missing.
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
    """Advance states (n, 13) in place by at most `steps` time steps. Returns the certain rest (n,)
    of each, or -1, and the numbers of steps (n,)."""
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
    return advance_throws("soft", body, table, np.array(how), states, steps)


def advance_throws(
    contacts: Literal["soft", "hard"],
    body: RigidBody,
    table: Table,
    how: Floats,
    states: Floats,
    steps: int,
) -> tuple[Integers, Integers]:
    """Advance states (n, 13) in place by at most `steps` time steps, with contacts of a kind and
    their parameters, see `dicedesign.kernels.ops.advance_throws`. Returns the certain rest (n,) of
    each, or -1, and the numbers of steps (n,).

    Raises InputError if the compiled kernels are missing.
    """
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
    advanced = kernels.advance_throws(contacts, landscape, moments, how, states, steps)
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
