"""Dice whose odds jump when a file rounds them, and those whose odds do not."""

from __future__ import annotations

import numpy as np
import pytest

import dicedesign as dd
from dicedesign.methods import ExactOptions, FacetCoordinates, solve_exactly
from dicedesign.optimize.solvers.candidate import CandidateMaker, largest_jump
from dicedesign.starts import Start

PRIOR = dd.VonMisesFisher([0.2, 0.1, -1.0], 2.0)
WEDGE = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0], [-1, 0, 2], [2, 0, 2.0]])
WEDGE = np.concatenate([WEDGE, WEDGE[4:] + np.array([0, 1, 0])])


@pytest.mark.parametrize(("aside", "jumps"), [(0.3, False), (1e-9, True)])
def test_a_center_of_mass_over_an_edge_is_a_place_to_jump(aside: float, jumps: bool) -> None:
    center = np.array([aside, 0.5, 0.9])
    poses = dd.rest_poses(WEDGE, center).under(PRIOR)
    coordinates, parameters = FacetCoordinates.of(WEDGE, center)
    candidate = CandidateMaker(center).attempt(coordinates, parameters, poses.normals)
    assert candidate is not None
    jump = largest_jump(candidate, poses.probabilities, PRIOR)
    assert jump > 1e-3 if jumps else jump < 1e-6


def test_the_solver_takes_a_prior_by_its_text() -> None:
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    start = Start(cube, dd.rest_poses(cube).normals)
    target = np.array([0.3, 0.14, 0.14, 0.14, 0.14, 0.14])
    found = solve_exactly([start], target, ExactOptions(), prior="vmf:0,0,1:1")
    assert found.status is dd.Status.CONVERGED
    poses = dd.rest_poses(found.hull.vertices, "hull").under("vmf:0,0,1:1")
    nearest = np.argmax(found.directions @ poses.normals.T, axis=1)
    np.testing.assert_allclose(poses.probabilities[nearest], target, atol=1e-12)


def test_a_prior_goes_with_no_symmetry() -> None:
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    start = Start(cube, dd.rest_poses(cube).normals)
    with pytest.raises(dd.InputError, match="symmetry"):
        solve_exactly(
            [start],
            np.full(6, 1 / 6),
            ExactOptions(),
            group=dd.point_group("C2"),
            prior="half:0,0,1",
        )
