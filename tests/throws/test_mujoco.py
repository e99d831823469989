"""The example engine, MuJoCo, as a second opinion where soft and hard contacts have to agree, and
certain rests, compiled and in Python."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import BOARD, alike, random_body

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.throws.engines import ENGINES
from dicedesign.throws.simulation import simulate
from examples.mujoco_engine import MUJOCO, final_rest, rest_below


@compiled_only
def test_rests_compiled_and_in_python() -> None:
    for seed in range(3):
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


def test_a_body_can_leave_a_basin_over_its_lowest_saddle_only() -> None:
    body, _ = random_body(3)
    for rest, normal in enumerate(body.rest_normals):
        barrier = float(body.barriers[rest])
        assert final_rest(body, normal, 0.999 * barrier) == rest
        assert final_rest(body, normal, 1.001 * barrier) == -1


@pytest.fixture
def mujoco() -> Iterator[str]:
    """Name of the engine, which is registered."""
    pytest.importorskip("mujoco", reason="the extra 'bench' is not installed")
    yield ENGINES.register(MUJOCO).name
    ENGINES.unregister(MUJOCO.name)


@compiled_only
def test_frequencies_without_friction(mujoco: str) -> None:
    """There is no slip to couple with, and soft contacts have the table's restitution."""
    body, _ = random_body(1)
    table = replace(BOARD, friction=0.0, speed=0.0, spin=0.0)
    ours = simulate(body, table, 2000, 1).counts
    theirs = simulate(body, table, 100, 2, engine=mujoco)
    assert theirs.unresolved == 0
    assert alike(ours, theirs.counts) > 1e-3
