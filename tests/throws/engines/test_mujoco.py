"""The package's own engine against MuJoCo, throw by throw and by frequency."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import BOARD, OCTAHEDRON, alike, box, random_body, random_points, thrown
from scipy.spatial.transform import Rotation

from dicedesign.errors import InputError
from dicedesign.throws.engines import GRAVITY, contact_of
from dicedesign.throws.mujoco_engine import _advance, _scene, throw_states
from dicedesign.throws.native import advance
from dicedesign.throws.release import released
from dicedesign.throws.rigid_body import RigidBody
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, table_named

CARPET, PAPER = table_named("carpet"), table_named("paper")


def let_go(body: RigidBody, table: Table, drops: int) -> np.ndarray:
    return released(body, table, np.arange(drops), "uniform", np.random.default_rng(0))


def balanced(points: np.ndarray) -> np.ndarray:
    """Points whose hull has the same moment of inertia about every axis."""
    body, _ = thrown(points)
    # Second moments of its mass along the principal axes.
    squares = body.moments.sum() / 2.0 - body.moments
    return points @ (body.axes / np.sqrt(squares)) @ body.axes.T


def turned(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A vector of the body in the world; quaternion: w, x, y, z."""
    world: np.ndarray = Rotation.from_quat(np.roll(quaternion, -1)).apply(vector)
    return world


@compiled_only
@pytest.mark.parametrize("table", [BOARD, PAPER])
@pytest.mark.parametrize("points", [OCTAHEDRON, random_points(1)])
def test_throw_by_throw(table: Table, points: np.ndarray) -> None:
    """Most to 1e-5 until well after the first impacts: MuJoCo rounds corners to 24 bits, and
    differs where more of them touch than it looks for. Its steps of free rotation are right only
    of bodies that need no torque for it."""
    mujoco = pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    body, _ = thrown(balanced(points))
    assert np.ptp(body.moments) < 1e-9
    contact = contact_of(table)
    model = mujoco.MjModel.from_xml_string(_scene(body, table, contact))
    # Our own steps of a contact.
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data = mujoco.MjData(model)
    states = let_go(body, table, 20)
    steps = round((np.sqrt(2.0 * table.height / 9.81) + 0.02) / contact.step)
    bounced, errors = [], []
    for state in states:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[:7], state[7:]
        mujoco.mj_step(model, data, steps)
        ours = state[None].copy()
        advance(body, table, ours, steps)
        bounced.append(np.abs(ours[0, 10:] - state[10:]).max() > 1.0)
        turn = ours[0, 3:7] * np.sign(ours[0, 3:7] @ data.qpos[3:])
        errors.append(
            max(
                np.abs(ours[0, :3] - data.qpos[:3]).max() / (table.size / 2.0),
                np.abs(turn - data.qpos[3:]).max(),
                np.abs(ours[0, 7:10] - data.qvel[:3]).max(),
                np.abs(ours[0, 10:] - data.qvel[3:]).max() / 100.0,
            )
        )
    assert all(bounced)
    assert np.median(errors) < 2e-6
    assert np.quantile(errors, 0.75) < 1e-5


@pytest.mark.parametrize("points", [OCTAHEDRON * [1.0, 1.1, 1.2], box(0.3, 1.0, 2.0)])
def test_a_long_flight(points: np.ndarray) -> None:
    """It falls as a point does, and keeps the energy and the angular momentum of its spin, as fast
    as a throw can make it."""
    mujoco = pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    body, _ = thrown(points)
    contact = contact_of(BOARD)
    model = mujoco.MjModel.from_xml_string(_scene(body, BOARD, contact))
    data = mujoco.MjData(model)
    seconds = 32 * contact.step
    for state in let_go(body, BOARD, 4):
        state[2] += 5.0
        state[10:] *= 150.0 / BOARD.spin
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[:7], state[7:]
        flown = 0.0
        while flown < 0.5:
            _advance(mujoco, model, data, contact, BOARD.size / 2.0)
            flown += seconds
        assert data.time == pytest.approx(flown)
        assert data.qpos[2] == pytest.approx(state[2] - 0.5 * GRAVITY * flown**2, rel=1e-9)
        after = np.concatenate([data.qpos, data.qvel])
        energies = [one[10:] ** 2 @ body.moments for one in (state, after)]
        momenta = [turned(one[3:7], body.moments * one[10:]) for one in (state, after)]
        assert energies[1] == pytest.approx(energies[0], rel=1e-4)
        np.testing.assert_allclose(*momenta, atol=3e-3 * np.linalg.norm(momenta[0]))


@compiled_only
@pytest.mark.parametrize(("table", "drops"), [(BOARD, 150), (CARPET, 150)])
def test_frequencies(table: Table, drops: int) -> None:
    pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    body, _ = random_body(1)
    ours = simulate(body, table, 2000, 1).counts
    theirs = simulate(body, table, drops, 2, engine="mujoco")
    assert theirs.unresolved == 0
    assert alike(ours, theirs.counts) > 1e-3


def test_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    body, _ = random_body(1)
    with pytest.raises(InputError, match=r"engine mujoco: expected the optional extra 'throws'"):
        throw_states(body, BOARD, let_go(body, BOARD, 1))
