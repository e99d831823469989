"""Where bodies end: compiled, in Python, and by rolling them."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only
from common.thrown import random_body

from dicedesign.geometry.sphere import unit_vectors
from dicedesign.kernels import ops as kernels
from dicedesign.rest.roll import roll_steps
from dicedesign.throws.mujoco_engine import final_rest, rest_below


@pytest.mark.parametrize("seed", range(10))
def test_against_a_roll_to_rest(seed: int) -> None:
    body, poses = random_body(seed)
    for down in unit_vectors(np.random.default_rng(seed).normal(size=(40, 3))):
        steps = roll_steps(poses.morse.equilibria, down)
        rest = rest_below(body, down @ body.axes)
        np.testing.assert_allclose(poses.normals[rest], steps[-1].down, atol=1e-9)


@compiled_only
@pytest.mark.parametrize("seed", range(10))
def test_compiled_and_in_python(seed: int) -> None:
    body, _ = random_body(seed)
    downs = unit_vectors(np.random.default_rng(seed).normal(size=(200, 3)))
    found = kernels.compiled.rests_below(
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
    np.testing.assert_array_equal(found, [rest_below(body, down) for down in downs])


@pytest.mark.parametrize("seed", [3, 8])
def test_basins_have_their_areas(seed: int) -> None:
    """By counting directions."""
    body, poses = random_body(seed)
    downs = unit_vectors(np.random.default_rng(seed).normal(size=(3000, 3)))
    rests = [rest_below(body, down) for down in downs]
    shares = np.bincount(rests, minlength=len(poses.probabilities)) / 3000
    np.testing.assert_allclose(shares, poses.probabilities, atol=4 * 0.5 / np.sqrt(3000))


@pytest.mark.parametrize("seed", range(4))
def test_a_body_can_leave_a_basin_over_its_lowest_saddle_only(seed: int) -> None:
    body, _ = random_body(seed)
    for rest, normal in enumerate(body.rest_normals):
        barrier = float(body.barriers[rest])
        assert final_rest(body, normal, 0.999 * barrier) == rest
        assert final_rest(body, normal, 1.001 * barrier) == -1
