"""Simulators of throws, and the package's own: compiled throws of a convex hull onto a plane."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.runtime.registry import Extension, Registry
from dicedesign.throws.tables import GRAVITY, most_of

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


ENGINES = Registry(
    "engine",
    Engine,
    builtin=("dicedesign.throws.engines:NATIVE",),
    group="dicedesign.engines",
)


def require_engine(name: str) -> Engine:
    """Engine of a name. Raises InputError if there is none, or it is not installed."""
    engine = ENGINES[name]
    engine.require()
    return engine


SETTLING = 400.0
"""Time after the bounces until a throw is given up, in units of the square root of radius over
gravity: about 14 seconds for a die of 25 mm."""


def longest_throw(table: Table) -> float:
    """Seconds after which a throw is given up: the time until a bouncing ball is at rest, plus
    `SETTLING` for tumbling, sliding and rolling."""
    # A ball that falls for a time t bounces for 2 e t, then for 2 e^2 t and so on, with restitution
    # e: t (1 + e) / (1 - e) in total.
    fall = math.sqrt(2.0 * most_of(table.height) / GRAVITY)
    bouncing = fall * ((1.0 + table.restitution) / (1.0 - table.restitution))
    return bouncing + SETTLING * math.sqrt(table.size / 2.0 / GRAVITY)


CONTACT_LAW = "impacts"
"""Contact law of the engine native, by which a checkpoint of its throws is known: one of another
law must not be continued."""

STEPS_PER_FALL = 32.0
"""Time steps in the square root of radius over gravity, of a die that stays on the table. Twice or
four times as many change the probabilities of dice by no more than chance in 20,000 throws; those
of basins shallower than a thousandth of the radius need them."""

MISSING = (
    "engine native: expected the compiled kernels, but they were not built; install the package "
    "where there is a C++ compiler"
)


def time_step(table: Table, refinement: float = 1.0) -> float:
    """Time step in seconds of a die that stays on the table. refinement: its divisor."""
    return math.sqrt(table.size / 2.0 / GRAVITY) / STEPS_PER_FALL / refinement


def require() -> None:
    """Raise InputError if the compiled kernels are missing."""
    if not kernels.available():
        raise InputError(MISSING)


def throw_states(
    body: RigidBody, table: Table, states: Floats, refinement: float = 1.0
) -> Integers:
    """Final rests (n,) of throws released in states (n, 13); -1 without a rest in time.

    Flight without drag is exact. Each impact is that of one vertex, the fastest first: the table's
    restitution is energetic, the root of the share of the work of compression that is returned
    (Stronge 1990), and friction is Coulomb's, whose direction turns with the slip during the impact
    (Keller 1986). So a restitution and a friction mean the same for all bodies and directions of
    impact. Vertices that approach slower than gravity makes them within a time step are stopped
    once a step. Energy never grows. A throw ends as soon as its energy is below every saddle on the
    border of its basin, which it cannot leave then, once it slides and spins to a stop without
    tipping, or if its state is not finite.

    refinement: divisor of the time step.

    Raises InputError if the compiled kernels are missing.
    """
    steps = round(longest_throw(table) / time_step(table, refinement))
    outcome, _ = advance(body, table, states.copy(), steps, refinement)
    return outcome


def advance(
    body: RigidBody, table: Table, states: Floats, steps: int, refinement: float = 1.0
) -> tuple[Integers, Integers]:
    """Advance states (n, 13) in place by at most `steps` time steps. Returns the certain rest (n,)
    of each, or -1, and the numbers of steps (n,).

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
        body.flat * [scale, scale, scale**2],
    )
    step = time_step(table, refinement)
    how = np.array([step, GRAVITY, table.drag, table.restitution, table.friction])
    advanced = kernels.advance_throws(landscape, body.moments * scale**2, how, states, steps)
    if advanced is None:
        raise InputError(MISSING)
    return advanced


NATIVE = Engine(
    name="native",
    line="the package's own, which needs the compiled kernels",
    title="native",
    phrase="the package's own engine",
    require=require,
    throw_states=throw_states,
)
