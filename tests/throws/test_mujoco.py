"""MuJoCo against the package's own engine, and certain rests."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import (
    BOARD,
    OCTAHEDRON,
    alike,
    random_body,
    random_points,
    rigid_body_with_rests,
    sample_states,
)

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.throws.engines import advance, contact_of
from dicedesign.throws.mujoco_engine import _scene, final_rest, rest_below
from dicedesign.throws.simulation import simulate
from dicedesign.throws.tables import Table, load_table


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


CARPET, PAPER = load_table("carpet"), load_table("paper")


def balance_inertia(points: np.ndarray) -> np.ndarray:
    """Points whose hull has equal moments of inertia."""
    body, _ = rigid_body_with_rests(points)
    # Second moments of its mass along the principal axes.
    squares = body.moments.sum() / 2.0 - body.moments
    return points @ (body.axes / np.sqrt(squares)) @ body.axes.T


@compiled_only
@pytest.mark.parametrize("table", [BOARD, PAPER])
@pytest.mark.parametrize("points", [OCTAHEDRON, random_points(1)])
def test_throw_by_throw(table: Table, points: np.ndarray) -> None:
    """Most throws agree to 1e-5 until after the first impacts. MuJoCo rounds corners to 24 bits,
    and limits the number of contacts. Its steps of free rotation are exact for equal moments
    only."""
    mujoco = pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    body, _ = rigid_body_with_rests(balance_inertia(points))
    assert np.ptp(body.moments) < 1e-9
    contact = contact_of(table)
    model = mujoco.MjModel.from_xml_string(_scene(body, table, contact))
    # The native engine's integrator in contacts.
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data = mujoco.MjData(model)
    states = sample_states(body, table, 20)
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


@compiled_only
@pytest.mark.parametrize("table", [BOARD, CARPET])
def test_frequencies(table: Table) -> None:
    pytest.importorskip("mujoco", reason="the extra 'throws' is not installed")
    body, _ = random_body(1)
    ours = simulate(body, table, 2000, 1).counts
    theirs = simulate(body, table, 60, 2, engine="mujoco")
    assert theirs.unresolved == 0
    assert alike(ours, theirs.counts) > 1e-3
