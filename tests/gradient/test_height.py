"""The support function against its definition, differences and the rests of the forward model."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import torch

from dicedesign import height, rest_poses
from dicedesign.geometry.sphere import unit_vectors

POINTS = np.random.default_rng(2).normal(size=(10, 3)) * [1.0, 1.5, 0.7]
DIRECTIONS = unit_vectors(np.random.default_rng(3).normal(size=(40, 3)))


def test_height_is_the_distance_of_the_lowest_corner() -> None:
    center = np.array([0.1, -0.2, 0.05])
    heights, _ = height(POINTS, 3.0 * DIRECTIONS.reshape(4, 10, 3), center)
    expected = [max((point - center) @ down for point in POINTS) for down in DIRECTIONS]
    assert heights.shape == (4, 10)
    np.testing.assert_allclose(heights.ravel(), expected, atol=1e-14)


def test_rests_saddles_and_maxima_are_critical_points() -> None:
    poses = rest_poses(POINTS)
    morse = poses.morse
    lowest, _ = height(POINTS, morse.minima)
    np.testing.assert_allclose(
        lowest, poses.hull.heights(poses.center_of_mass)[poses.facets], atol=1e-13
    )
    around = np.concatenate([DIRECTIONS, -DIRECTIONS])
    for down, least in zip(morse.minima, lowest, strict=True):
        assert (height(POINTS, down + 1e-3 * around)[0] > least).all()
    for down, most in zip(morse.maxima, height(POINTS, morse.maxima)[0], strict=True):
        assert (height(POINTS, down + 1e-3 * around)[0] < most).all()
    np.testing.assert_allclose(height(POINTS, morse.maxima)[1], 0.0, atol=1e-13)
    # Lower toward the facets beside a saddle's edge, higher along both of its separatrices.
    hull, half_edges = poses.hull, poses.basins[0].paths.saddles
    for place, (down, edge) in enumerate(zip(morse.saddles, half_edges, strict=True)):
        facets = hull.facet[[edge, hull.twin[edge]]]
        level = height(POINTS, down)[0]
        assert (height(POINTS, down + 1e-2 * (hull.normals[facets] - down))[0] < level).all()
        for branch in morse.branches[2 * place : 2 * place + 2]:
            # It may wait at the saddle.
            uphill = branch[np.abs(branch - down).max(axis=1) > 1e-9][0]
            assert height(POINTS, down + 1e-2 * (uphill - down))[0] > level


@pytest.mark.parametrize("given", [False, True])
def test_tensors_have_equal_values_and_derivatives(given: bool) -> None:
    points = torch.tensor(POINTS, requires_grad=True)
    directions = torch.tensor(2.0 * DIRECTIONS[:6], requires_grad=True)
    center = (torch.tensor([0.1, 0.0, 0.1]).double().requires_grad_(),) if given else ()
    arrays = height(POINTS, DIRECTIONS[:6], *(c.detach().numpy() for c in center))
    for tensor, expected in zip(height(points, directions, *center), arrays, strict=True):
        np.testing.assert_allclose(tensor.detach(), expected, atol=1e-14)
    assert torch.autograd.gradcheck(height, (points, directions, *center))
    slopes = torch.func.grad(lambda down: 2.0 * height(points.detach(), down)[0].sum())(
        directions.detach()
    )
    if not given:
        # By the direction itself, which is twice as long as a unit vector.
        np.testing.assert_allclose(slopes, arrays[1], atol=1e-13)


def test_arrays_do_not_load_torch() -> None:
    code = (
        "import sys, numpy as np, dicedesign as dd\n"
        "dd.height(np.eye(4)[:, :3], [1.0, 0.0, 0.0])\n"
        "print('torch' in sys.modules)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "False\n"
