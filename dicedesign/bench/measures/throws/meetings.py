"""Dice thrown in MuJoCo together with a second one, or towards a wall: where they end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dicedesign.runtime.arrays import Floats, Integers
from dicedesign.throws.engines import mujoco_engine
from dicedesign.throws.engines.contact import GRAVITY, IMPEDANCE, Contact, contact_of
from dicedesign.throws.engines.landing import final_rest
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.tables import Table

__all__ = ["BESIDE", "Companies", "Meeting", "meet"]

Companies: TypeAlias = Literal["die", "wall"]
"""A second die, let go beside the first; or a wall across its way."""

BESIDE: Final = 1.02
"""Distance between the centers of two dice that are let go, in sizes: they nearly touch."""

AHEAD: Final = 0.1
"""Of the wall, in m beyond the center of a die that is let go towards it."""

NEAR: Final = 1.7
"""Distance of centers, in sizes, below which two dice may touch before the next look at them: in
`STEPS_PER_LOOK` steps the fastest die of a table moves by 0.63 sizes."""

FINENESS: Final = 0.5
"""Of steps, relative to those of other throws. They are of first order, too, and add some energy to
a spin: alike with company and alone, so that what company changes does not ask for better ones."""

LIVELY: Final = 0.3
"""Restitution below which steps are as fine as those of other throws: contacts of such damping stop
a point in one of them."""

STEPS_PER_LOOK: Final = 32

STILL: Final = 1e-3
"""Speed, in units of the square root of radius times gravity, below which dice stand still."""

STILL_LOOKS: Final = 50
"""So many looks in a row: a die that leans on something then counts for nothing."""

_DIE: Final = """<body><freejoint/>
<inertial pos="0 0 0" mass="1" diaginertia="{moments}"/>
<geom name="die{number}" type="mesh" mesh="hull" mass="0"/></body>"""

_PAIR: Final = """<pair geom1="{one}" geom2="{other}" condim="3" friction="{friction} {friction}"
solref="{stiffness} {damping}" solreffriction="-1 {sliding}" solimp="{impedance} {impedance}"/>"""

_SCENE: Final = """<mujoco>
<compiler boundmass="0" boundinertia="0" inertiafromgeom="false"/>
<option timestep="{step}" gravity="0 0 {gravity}" cone="elliptic" tolerance="1e-12"/>
<asset><mesh name="hull" vertex="{vertices}"/></asset>
<worldbody><geom name="table" type="plane" size="1 1 1"/>{wall}{dice}</worldbody>
<contact>{pairs}</contact></mujoco>"""

_WALL: Final = '<geom name="wall" type="plane" size="1 1 1" pos="{ahead} 0 0" zaxis="-1 0 0"/>'


@dataclass(frozen=True)
class Meeting:
    """Ends of throws in company.

    Attributes
    ----------
    rests: (n, d) of d dice that were thrown together; -1 for none in time, or a die that leans.
    touched: (n,) whether a die touched the other, or the wall.
    """

    rests: Integers
    touched: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: Sequence[Meeting]) -> Meeting:
        """All of them."""
        rests, touched = ([getattr(part, name) for part in parts] for name in ("rests", "touched"))
        return cls(np.concatenate(rests), np.concatenate(touched))


def meet(body: RigidBody, table: Table, states: Floats, company: Companies | None) -> Meeting:
    """Throw dice together, n times.

    states: (n, d, 13) as of `released`, of two dice for the company "die", else of one.

    A throw ends when no die can leave its basin any more, not even with all the energy that the
    other can give away.

    Raises InputError: MuJoCo is not installed.
    """
    mujoco = mujoco_engine.require()
    contact = contact_of(table, FINENESS if table.restitution >= LIVELY else 1.0)
    dice = states.shape[1]
    model = mujoco.MjModel.from_xml_string(_scene(body, table, contact, dice, company))
    data = mujoco.MjData(model)
    looks = round(contact.seconds / contact.step) // STEPS_PER_LOOK
    rests, touched = np.full((len(states), dice), -1), np.zeros(len(states), dtype=bool)
    still = STILL * np.sqrt(GRAVITY * table.size / 2.0)
    for i, state in enumerate(states):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[:, :7].ravel(), state[:, 7:].ravel()
        places, motions = data.qpos.reshape(dice, 7), data.qvel.reshape(dice, 6)
        stood = 0
        for _ in range(looks):
            if not touched[i] and _is_near(places, table.size, company):
                for _ in range(STEPS_PER_LOOK):
                    mujoco.mj_step(model, data)
                    touched[i] |= bool((data.contact.geom > 0).all(axis=1).any())
            else:
                mujoco.mj_step(model, data, STEPS_PER_LOOK)
            stood = stood + 1 if np.abs(motions).max() < still else 0
            rests[i] = _ends(body, table, contact, places, motions)
            if rests[i, 0] >= 0 or stood > STILL_LOOKS:
                break
    return Meeting(rests, touched)


def _scene(
    body: RigidBody, table: Table, contact: Contact, dice: int, company: Companies | None
) -> str:
    scale = table.size / 2.0
    names = [f"die{number}" for number in range(dice)]
    grounds = ["table"] + ["wall"] * (company == "wall")
    pairs = [(ground, name) for ground in grounds for name in names] + [tuple(names)] * (dice == 2)
    moments = _listed(body.moments * scale**2)
    how = {
        "friction": table.friction,
        "stiffness": -contact.stiffness,
        "damping": -contact.damping,
        "sliding": -contact.sliding_damping,
        "impedance": IMPEDANCE,
    }
    return _SCENE.format(
        step=contact.step,
        gravity=-GRAVITY,
        vertices=_listed((body.vertices * scale).ravel()),
        wall=_WALL.format(ahead=AHEAD) * (company == "wall"),
        dice="".join(_DIE.format(moments=moments, number=number) for number in range(dice)),
        pairs="".join(_PAIR.format(one=one, other=other, **how) for one, other in pairs),
    )


def _listed(numbers: Floats) -> str:
    return " ".join(repr(float(x)) for x in numbers)


def _is_near(places: Floats, size: float, company: Companies | None) -> bool:
    if company == "die":
        return bool(np.linalg.norm(places[0, :3] - places[1, :3]) < NEAR * size)
    return company == "wall" and bool(AHEAD - places[0, 0] < (NEAR - 0.5) * size)


def _ends(
    body: RigidBody, table: Table, contact: Contact, places: Floats, motions: Floats
) -> Integers:
    """(d,) the rests that dice cannot miss any more, all -1 while one of them can."""
    scale, none = table.size / 2.0, np.full(len(places), -1)
    moving = (motions[:, :3] ** 2).sum(axis=1) + scale**2 * (motions[:, 3:] ** 2 @ body.moments)
    energies = (places[:, 2] + 0.5 * moving / GRAVITY) / scale
    if energies.max() >= body.barriers.max():
        return none
    w, x, y, z = places[:, 3:].T
    up = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], 1)
    depths = np.minimum(places[:, 2] + scale * (body.vertices @ up.T), 0.0)
    energies += 0.5 * contact.stiffness * (depths**2).sum(axis=0) / GRAVITY / scale
    rests = [final_rest(body, -axis, own) for axis, own in zip(up, energies, strict=True)]
    if min(rests) >= 0:
        # What the others can give away.
        spare = energies - body.rest_heights[rests]
        energies += spare.sum() - spare
        rests = [final_rest(body, -axis, own) for axis, own in zip(up, energies, strict=True)]
    return np.array(rests) if min(rests) >= 0 else none
