"""What engines are told about contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.thrown import BOARD
from scipy.integrate import solve_ivp

from dicedesign.throws.engines import (
    DEEPEST,
    GRAVITY,
    contact_of,
    damping_ratio,
    longest_throw,
    restitution_of,
)
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


@pytest.mark.parametrize("table", [BOARD, table_named("hard-wood"), table_named("paper")])
def test_the_fastest_impact_goes_no_deeper_than_it_may(table: Table) -> None:
    """That of the whole body at once; depths scale with speed over frequency."""
    contact = contact_of(table)
    radius = table.size / 2.0
    frequency = np.sqrt(contact.stiffness)
    speed = np.sqrt(2.0 * GRAVITY * (table.height + radius)) + table.spin * radius
    ratio = contact.damping / 2.0 / frequency
    assert bounce(ratio)[1] * speed / frequency < 1.1 * DEEPEST * radius


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95])
def test_a_throw_is_followed_while_a_ball_bounces(restitution: float) -> None:
    table = replace(BOARD, height=30.0, restitution=restitution)
    speed = np.sqrt(2.0 * GRAVITY * 30.0)
    bounces = 2.0 * speed * restitution ** np.arange(1, 1000) / GRAVITY
    ball = speed / GRAVITY + bounces.sum()
    set_down = longest_throw(replace(table, height=0.0))
    assert longest_throw(table) == pytest.approx(ball + set_down, rel=1e-12)
    assert 14.0 < set_down < 15.0
