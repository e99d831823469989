"""The package's own engine, against closed forms, conservation laws and symmetry."""

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
    thrown,
    turn_down,
)
from scipy.spatial.transform import Rotation

from dicedesign.errors import InputError
from dicedesign.kernels import ops as kernels
from dicedesign.throws.engines import GRAVITY, advance, contact_of, throw_states
from dicedesign.throws.rigid_body import RigidBody, released
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, table_named

WOOD, CARPET, PAPER = (table_named(name) for name in ("hard-wood", "carpet", "paper"))


def turn_of(states: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) from principal axes to the world."""
    return Rotation.from_quat(np.roll(states[:, 3:7], -1, axis=1)).as_matrix()


def let_go(body: RigidBody, table: Table, drops: int, seed: int = 0) -> np.ndarray:
    return released(body, table, np.arange(drops), "uniform", np.random.default_rng(seed))


def flown(body: RigidBody, table: Table, seconds: float) -> tuple:
    """States before and after a flight high above the table."""
    before = let_go(body, table, 20)
    before[:, 2] = 1000.0
    after = before.copy()
    step = contact_of(table).step
    steps = round(seconds / step)
    rests, taken = advance(body, table, after, steps)
    assert (rests == -1).all()
    assert (taken == steps).all()
    return before, after, steps * step


@compiled_only
def test_a_symmetric_top_in_flight() -> None:
    """Without torque the spin turns about the axis of symmetry, in the body's frame."""
    body, _ = thrown(box(1.0, 1.0, 2.0))
    along, across = body.moments[0], body.moments[1]
    assert body.moments[2] == pytest.approx(across)
    before, after, seconds = flown(body, WOOD, 0.3)
    angle = (across - along) / across * before[:, 10] * seconds
    cosine, sine = np.cos(angle), np.sin(angle)
    w = before[:, 10:]
    expected = np.stack(
        [w[:, 0], cosine * w[:, 1] + sine * w[:, 2], cosine * w[:, 2] - sine * w[:, 1]], axis=1
    )
    np.testing.assert_allclose(after[:, 10:], expected, atol=1e-9 * WOOD.spin)


@compiled_only
def test_energy_and_angular_momentum_in_flight() -> None:
    body, _ = thrown(random_points(2))
    before, after, seconds = flown(body, WOOD, 0.3)
    fallen = before[:, 9] * seconds - 0.5 * GRAVITY * seconds**2
    np.testing.assert_allclose(after[:, 2] - before[:, 2], fallen, rtol=1e-3)
    np.testing.assert_allclose(after[:, 7:9], before[:, 7:9])
    first, last = (
        np.einsum("nij,nj->ni", turn_of(state), state[:, 10:] * body.moments)
        for state in (before, after)
    )
    np.testing.assert_allclose(last, first, atol=1e-9 * WOOD.spin)
    np.testing.assert_allclose(spin_energies(body, after), spin_energies(body, before), rtol=1e-9)


def spin_energies(body: RigidBody, states: np.ndarray) -> np.ndarray:
    """Twice those of a body of unit radius and mass, (n,)."""
    return states[:, 10:] ** 2 @ body.moments


@compiled_only
@pytest.mark.parametrize("entry", [2, 3, 9, 12])
@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_motion_that_is_not_finite_ends(entry: int, number: float) -> None:
    body, _ = random_body(1)
    states = let_go(body, BOARD, 3)
    states[1, entry] = number
    rests, taken = advance(body, BOARD, states, 400)
    assert rests.tolist() == [-1, -1, -1]
    assert taken.tolist() == [400, 16, 400]


@compiled_only
@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8])
def test_a_ball_bounces(restitution: float) -> None:
    """An octahedron that falls straight onto a vertex keeps that part of its speed, and comes up to
    its square of the height."""
    body, _ = thrown(OCTAHEDRON)
    table = replace(BOARD, restitution=restitution, speed=0.0, spin=0.0)
    state = let_go(body, table, 1)
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
def test_what_a_body_cannot_miss_it_does_not(table: Table) -> None:
    """Throws go on after their rest is certain, and end at no other."""
    for seed in (1, 4):
        body, _ = random_body(seed)
        states = let_go(body, table, 80)
        rests, _ = advance(body, table, states, 100_000)
        assert (rests >= 0).all()
        for _ in range(100):
            # Until it is looked at again. Steps of finite length may lift its energy for a moment.
            again, _ = advance(body, table, states, 16)
            assert ((again == rests) | (again == -1)).all()
        np.testing.assert_array_equal(again, rests)


@compiled_only
def test_a_box_has_the_odds_of_its_symmetry() -> None:
    body, poses = thrown(box(1.0, 1.15, 1.3))
    throws = simulate(body, BOARD, 3000, 1)
    assert throws.unresolved == 0
    pairs = throws.counts.reshape(3, 2)
    # Opposite sides are alike.
    for pair in pairs:
        assert fits(pair, [0.5, 0.5]) > 1e-3
    # Momentum makes the likely ones likelier.
    assert fits(throws.counts, poses.probabilities) < 1e-6
    assert pairs[0].sum() / 3000 > poses.probabilities[:2].sum()


def test_without_the_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "compiled", None)
    body, _ = random_body(1)
    with pytest.raises(InputError, match=r"engine native: expected the compiled kernels, .*mujoco"):
        throw_states(body, BOARD, let_go(body, BOARD, 1))
