"""Contacts: restitution against a bounce that is integrated by another method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import BOARD, box, thrown
from scipy.integrate import solve_ivp

from dicedesign.throws.engines import (
    DEEPEST,
    GRAVITY,
    LARGEST_RATIO,
    STEPS_PER_CONTACT,
    contact_of,
    damping_ratio,
    longest_throw,
    restitution_of,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, table_named


def bounce(ratio: float) -> tuple[float, float]:
    """Speed after a bounce off a spring and damper with unit frequency at unit speed, and the
    largest depth."""

    def force(_time: float, state: np.ndarray) -> float:
        return -state[0] - 2.0 * ratio * state[1]

    def leaves(time: float, state: np.ndarray) -> float:
        return force(time, state) if time > 0.0 and state[1] > 0.0 else 1.0

    leaves.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(
        lambda t, y: (y[1], force(t, y)),
        (0.0, 100.0),
        (0.0, -1.0),
        events=leaves,
        rtol=1e-11,
        atol=1e-13,
        max_step=0.05,
    )
    return float(found.y_events[0][0][1]), float(-found.y[0].min())


@pytest.mark.parametrize("restitution", [0.05, 0.1, np.exp(-2.0), 0.3, 0.5, 0.7, 0.9])
def test_the_damping_ratio_of_a_restitution(restitution: float) -> None:
    ratio = damping_ratio(restitution)
    assert restitution_of(ratio) == pytest.approx(restitution, abs=1e-12)
    assert bounce(ratio)[0] == pytest.approx(restitution, abs=1e-7)


def test_the_ends() -> None:
    assert damping_ratio(0.0) == pytest.approx(LARGEST_RATIO)
    assert restitution_of(0.0) == 1.0
    # On both sides of critical damping.
    for ratio in (1.0 - 1e-9, 1.0, 1.0 + 1e-9):
        assert restitution_of(ratio) == pytest.approx(np.exp(-2.0), abs=1e-8)


@pytest.mark.parametrize("table", [BOARD, table_named("hard-wood"), table_named("paper")])
def test_the_fastest_impact_goes_no_deeper_than_it_may(table: Table) -> None:
    """That of the whole body at once; depths scale with speed over frequency."""
    contact = contact_of(table)
    radius = table.size / 2.0
    frequency = np.sqrt(contact.stiffness)
    speed = np.sqrt(2.0 * GRAVITY * (table.height + radius)) + table.spin * radius
    ratio = contact.damping / 2.0 / frequency
    assert bounce(ratio)[1] * speed / frequency < 1.1 * DEEPEST * radius


def test_steps() -> None:
    contact = contact_of(BOARD)
    assert np.pi / np.sqrt(contact.stiffness) / contact.step == pytest.approx(STEPS_PER_CONTACT)
    finer = contact_of(BOARD, 2.0)
    assert finer.step == pytest.approx(contact.step / 2.0)
    assert replace(finer, step=contact.step) == contact
    # One step takes no more than all of the speed.
    dead = contact_of(replace(BOARD, restitution=0.0))
    assert dead.damping * dead.step <= 1.0 + 1e-12


def test_a_stiffer_contact() -> None:
    """It has the same restitution and as many steps in a bounce, and goes less deep."""
    contact, stiffer = contact_of(BOARD), contact_of(BOARD, stiffness=4.0)
    assert stiffer.stiffness == pytest.approx(4.0 * contact.stiffness)
    for name in ("damping", "sliding_damping"):
        assert getattr(stiffer, name) == pytest.approx(2.0 * getattr(contact, name))
    assert stiffer.step == pytest.approx(contact.step / 2.0)
    assert stiffer.seconds == contact.seconds


def test_contacts_scale_with_the_die() -> None:
    """A table for dice twice as large, with all that follows from it, is the same in their own
    units: lengths of 2, times of sqrt 2."""
    root = np.sqrt(2.0)
    large = replace(
        BOARD,
        size=2 * BOARD.size,
        height=2 * BOARD.height,
        speed=root * BOARD.speed,
        spin=BOARD.spin / root,
    )
    one, two = contact_of(BOARD), contact_of(large)
    assert two.step == pytest.approx(root * one.step)
    assert two.seconds == pytest.approx(root * one.seconds)
    assert two.stiffness == pytest.approx(one.stiffness / 2.0)
    assert two.damping == pytest.approx(one.damping / root)


def test_a_contact_is_that_of_the_fastest_throw() -> None:
    fastest = replace(BOARD, height=0.2, speed=0.6, spin=25.0)
    ranges = replace(BOARD, height=(0.05, 0.2), speed=(0.0, 0.6), spin=(5.0, 25.0))
    assert contact_of(ranges) == contact_of(fastest)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95])
def test_a_throw_is_followed_while_a_ball_bounces(restitution: float) -> None:
    table = replace(BOARD, height=30.0, restitution=restitution)
    speed = np.sqrt(2.0 * GRAVITY * 30.0)
    bounces = 2.0 * speed * restitution ** np.arange(1, 1000) / GRAVITY
    ball = speed / GRAVITY + bounces.sum()
    set_down = longest_throw(replace(table, height=0.0))
    assert longest_throw(table) == pytest.approx(ball + set_down, rel=1e-12)
    assert 14.0 < set_down < 15.0


@compiled_only
def test_throws_that_bounce_long_come_to_rest_in_time() -> None:
    """For which the time that dice need without bouncing is too short."""
    table = replace(BOARD, height=1.0, restitution=0.95, friction=1.0)
    body, _ = thrown(box(1.0, 1.0, 1.0))
    assert simulate(body, table, 30).unresolved == 0
