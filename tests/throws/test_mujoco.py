"""MuJoCo as a second opinion where soft and hard contacts have to agree, its contact parameters,
and certain rests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import BOARD, alike, random_body
from scipy.integrate import solve_ivp

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.throws.mujoco_engine import (
    DEEPEST,
    contact_of,
    damping_ratio,
    final_rest,
    rest_below,
    restitution_of,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import GRAVITY, Table, load_table


@compiled_only
@pytest.mark.parametrize("seed", range(3))
def test_compiled_and_in_python(seed: int) -> None:
    body, _ = random_body(seed)
    downs = unit_vectors(np.random.default_rng(seed).normal(size=(200, 3)))
    compiled = kernels.compiled.rests_below(
        body.vertices,
        body.start,
        body.neighbors,
        body.left,
        body.right,
        body.normals,
        body.rest_of_facet,
        body.barriers,
        downs,
    )
    np.testing.assert_array_equal(compiled, [rest_below(body, down) for down in downs])


@pytest.mark.parametrize("seed", range(4))
def test_a_body_can_leave_a_basin_over_its_lowest_saddle_only(seed: int) -> None:
    body, _ = random_body(seed)
    for rest, normal in enumerate(body.rest_normals):
        barrier = float(body.barriers[rest])
        assert final_rest(body, normal, 0.999 * barrier) == rest
        assert final_rest(body, normal, 1.001 * barrier) == -1


def bounce(ratio: float) -> tuple[float, float]:
    """Speed after a bounce off a spring and damper with unit frequency at unit speed, and the
    largest depth."""

    def force(_time: float, state: np.ndarray) -> float:
        return -state[0] - 2.0 * ratio * state[1]

    def leaves(time: float, state: np.ndarray) -> float:
        return force(time, state) if time > 0.0 and state[1] > 0.0 else 1.0

    leaves.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(
        lambda t, y: (y[1], force(t, y)),
        (0.0, 100.0),
        (0.0, -1.0),
        events=leaves,
        rtol=1e-11,
        atol=1e-13,
        max_step=0.05,
    )
    return float(solution.y_events[0][0][1]), float(-solution.y[0].min())


@pytest.mark.parametrize("restitution", [0.05, 0.1, np.exp(-2.0), 0.3, 0.5, 0.7, 0.9])
def test_the_damping_ratio_of_a_restitution(restitution: float) -> None:
    ratio = damping_ratio(restitution)
    assert restitution_of(ratio) == pytest.approx(restitution, abs=1e-12)
    assert bounce(ratio)[0] == pytest.approx(restitution, abs=1e-7)


@pytest.mark.parametrize("table", [BOARD, load_table("hard-wood"), load_table("paper")])
def test_the_depth_of_the_fastest_impact(table: Table) -> None:
    """Of the whole body at once; depths scale with speed over frequency."""
    contact = contact_of(table)
    radius = table.size / 2.0
    frequency = np.sqrt(contact.stiffness)
    speed = np.sqrt(2.0 * GRAVITY * (table.height + radius)) + table.spin * radius
    ratio = contact.damping / 2.0 / frequency
    assert bounce(ratio)[1] * speed / frequency < 1.1 * DEEPEST * radius


FRICTIONLESS = replace(BOARD, friction=0.0, speed=0.0, spin=0.0)
"""Without friction there is no slip to couple with, and soft contacts have the table's
restitution."""


@compiled_only
@pytest.mark.parametrize("table", [FRICTIONLESS, load_table("carpet")])
def test_frequencies_without_friction_or_momentum(table: Table) -> None:
    pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    body, _ = random_body(1)
    ours = simulate(body, table, 2000, 1).counts
    theirs = simulate(body, table, 100, 2, engine="mujoco")
    assert theirs.unresolved == 0
    assert alike(ours, theirs.counts) > 1e-3
