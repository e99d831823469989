"""Contact parameters and the package's own engine, against closed forms, conservation laws and
symmetry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import (
    BOARD,
    OCTAHEDRON,
    box,
    fits,
    random_body,
    random_points,
    rigid_body_with_rests,
    sample_states,
    turn_down,
    turns_of,
)
from scipy.integrate import solve_ivp

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.throws.engines import (
    DEEPEST,
    GRAVITY,
    advance,
    contact_of,
    damping_ratio,
    longest_throw,
    restitution_of,
    throw_states,
)
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, load_table

WOOD, CARPET, PAPER = (load_table(name) for name in ("hard-wood", "carpet", "paper"))


@compiled_only
def test_energy_and_angular_momentum_in_flight() -> None:
    body, _ = rigid_body_with_rests(random_points(2))
    before = sample_states(body, WOOD, 20)
    before[:, 2] = 1000.0
    after, step = before.copy(), contact_of(WOOD).step
    steps = round(0.3 / step)
    seconds = steps * step
    rests, taken = advance(body, WOOD, after, steps)
    assert (rests == -1).all()
    assert (taken == steps).all()
    fallen = before[:, 9] * seconds - 0.5 * GRAVITY * seconds**2
    np.testing.assert_allclose(after[:, 2] - before[:, 2], fallen, rtol=1e-3)
    np.testing.assert_allclose(after[:, 7:9], before[:, 7:9])
    first, last = (
        np.einsum("nij,nj->ni", turns_of(state), state[:, 10:] * body.moments)
        for state in (before, after)
    )
    np.testing.assert_allclose(last, first, atol=1e-9 * WOOD.spin)
    first, last = (state[:, 10:] ** 2 @ body.moments for state in (before, after))
    np.testing.assert_allclose(last, first, rtol=1e-9)


@compiled_only
@pytest.mark.parametrize(("entry", "number"), [(2, np.inf), (3, np.nan), (9, np.nan), (12, np.inf)])
def test_a_motion_that_is_not_finite_ends(entry: int, number: float) -> None:
    body, _ = random_body(1)
    states = sample_states(body, BOARD, 3)
    states[1, entry] = number
    rests, taken = advance(body, BOARD, states, 400)
    assert rests.tolist() == [-1, -1, -1]
    assert taken.tolist() == [400, 16, 400]


@compiled_only
@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8])
def test_a_ball_bounces(restitution: float) -> None:
    """An octahedron that falls onto a vertex rises to the squared restitution times the height."""
    body, _ = rigid_body_with_rests(OCTAHEDRON)
    table = replace(BOARD, restitution=restitution, speed=0.0, spin=0.0)
    state = sample_states(body, table, 1)
    state[0, 3:7] = turn_down(body.vertices[0])
    radius = table.size / 2.0
    state[0, 2] = table.height + radius
    fall = np.sqrt(2.0 * table.height / GRAVITY)
    finer = 16.0
    before = round(0.99 * fall / contact_of(table, finer).step)
    advance(body, table, state, before, finer)
    assert state[0, 9] < 0.0
    while state[0, 9] < 0.0 or state[0, 2] < radius:
        advance(body, table, state, 1, finer)
    top = state[0, 2] - radius + state[0, 9] ** 2 / 2.0 / GRAVITY
    assert np.sqrt(top / table.height) == pytest.approx(restitution, abs=0.008)


@compiled_only
@pytest.mark.parametrize("table", [BOARD, WOOD])
def test_certain_rests_are_reached(table: Table) -> None:
    """Throws that continue after their rest is certain end at no other rest."""
    for seed in (1, 4):
        body, _ = random_body(seed)
        states = sample_states(body, table, 80)
        rests, _ = advance(body, table, states, 100_000)
        assert (rests >= 0).all()
        for _ in range(100):
            # Until the next check. Finite steps may raise the energy for a moment.
            again, _ = advance(body, table, states, 16)
            assert ((again == rests) | (again == -1)).all()
        np.testing.assert_array_equal(again, rests)


@compiled_only
def test_a_box_has_the_probabilities_of_its_symmetry() -> None:
    body, poses = rigid_body_with_rests(box(1.0, 1.15, 1.3))
    throws = simulate(body, BOARD, 3000, 1)
    assert throws.unresolved == 0
    pairs = throws.counts.reshape(3, 2)
    # Opposite sides are equally probable.
    for pair in pairs:
        assert fits(pair, [0.5, 0.5]) > 1e-3
    # Momentum favors the most probable sides.
    assert fits(throws.counts, poses.probabilities) < 1e-6
    assert pairs[0].sum() / 3000 > poses.probabilities[:2].sum()


def test_without_the_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "compiled", None)
    body, _ = random_body(1)
    with pytest.raises(
        InputError, match=r"engines native and impulses: expected the compiled kernels, .*mujoco"
    ):
        throw_states(body, BOARD, sample_states(body, BOARD, 1))


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


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.95])
def test_the_time_limit_of_a_bouncing_ball(restitution: float) -> None:
    table = replace(BOARD, height=30.0, restitution=restitution)
    speed = np.sqrt(2.0 * GRAVITY * 30.0)
    bounces = 2.0 * speed * restitution ** np.arange(1, 1000) / GRAVITY
    ball = speed / GRAVITY + bounces.sum()
    set_down = longest_throw(replace(table, height=0.0))
    assert longest_throw(table) == pytest.approx(ball + set_down, rel=1e-12)
    assert 14.0 < set_down < 15.0
