"""Throws with hard contacts: impacts of single vertices, whose restitution and friction mean the
same for every die."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines import GRAVITY, Engine, advance_throws, longest_throw, require

if TYPE_CHECKING:
    from dicedesign.throws.rigid_body import RigidBody
    from dicedesign.throws.tables import Table

STEPS_PER_FALL: Final = 32.0
"""Time steps in the square root of radius over gravity, of a die that stays on the table. Twice or
four times as many change the probabilities of dice by no more than chance in 20,000 throws; those
of basins shallower than a thousandth of the radius need them."""


def time_step(table: Table, refinement: float = 1.0) -> float:
    """Time step in seconds of a die that stays on the table. refinement: its divisor."""
    return math.sqrt(table.size / 2.0 / GRAVITY) / STEPS_PER_FALL / refinement


def throw_states(
    body: RigidBody, table: Table, states: Floats, refinement: float = 1.0
) -> Integers:
    """Final rests (n,) of throws released in states (n, 13); -1 without a rest in time.

    Flight without drag is exact. Each impact is that of one vertex, the fastest first: the table's
    restitution is energetic, the root of the share of the work of compression that is returned
    (Stronge 1990), and friction is Coulomb's, whose direction turns with the slip during the impact
    (Keller 1986). So a restitution and a friction mean the same for all bodies and directions of
    impact. Vertices that approach slower than gravity makes them within a time step are stopped
    once a step. Energy never grows. A throw ends as in the engine native.

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
    of each, or -1, and the numbers of steps (n,)."""
    step = time_step(table, refinement)
    how = np.array([step, GRAVITY, table.drag, table.restitution, table.friction])
    return advance_throws("hard", body, table, how, states, steps)


IMPULSES: Final = Engine(
    name="impulses",
    line="the package's own, with impacts in place of soft contacts",
    title="impulses",
    phrase="the package's own engine with impacts",
    require=require,
    throw_states=throw_states,
)
