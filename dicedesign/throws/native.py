"""The package's own engine: compiled throws of one convex hull onto one plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines import GRAVITY, IMPEDANCE, Engine, contact_of

if TYPE_CHECKING:
    from dicedesign.throws.rigid_body import RigidBody
    from dicedesign.throws.tables import Table


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
    """Advance states (n, 13), in place, by at most so many time steps. Returns for each the rest
    that it cannot miss any more, or -1, and (n,) how many steps it took."""
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
    landscape, moments = _landscape(body, scale), body.moments * scale**2
    advanced = kernels.advance_throws(landscape, moments, np.array(how), states, steps)
    if advanced is None:
        raise InputError(MISSING)
    return advanced


def _landscape(body: RigidBody, scale: float) -> tuple[NDArray[np.generic], ...]:
    """The arrays of a body of some radius that the kernels take."""
    return (
        body.vertices * scale,
        body.start,
        body.neighbors,
        body.left,
        body.right,
        body.normals,
        body.rest_of_facet,
        body.barriers * scale,
    )


NATIVE: Final = Engine(
    name="native",
    line="the package's own",
    title="native",
    phrase="the package's own engine",
    require=require,
    throw_states=throw_states,
)
