"""Bodies whose corners are lattice points up to noise: decisions about them do not contradict."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from dicedesign.errors import OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest import basins as probabilities
from dicedesign.rest.basins import find_basins
from dicedesign.rest.poses import UNEVEN, rest_poses
from tests.reference.measurement import OK, measure, verdict
from tests.reference.problem import Problem

TIED = [(25, 20, 1e-12), (94, 20, 1e-12), (96, 20, 1e-12), (106, 20, 1e-12), (1, 40, 1e-13)]
"""Seed, points and noise of bodies that balance to within the unevenness of their facets, and in
which noise decides nothing once the center of mass is moved by a little more than that."""

BENT = [(24, 20, 1e-11), (31, 40, 1e-11), (120, 40, 1e-11), (123, 20, 1e-11), (251, 20, 1e-11)]
"""Of bodies some facets of which bend by less than that."""


def noisy_lattice(seed: int, count: int, noise: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.integers(-2, 3, size=(count, 3)) + noise * rng.normal(size=(count, 3))


def clustered(normals: np.ndarray) -> np.ndarray:
    """For each normal the first one that differs by rounding of the corners only."""
    return np.argmax(cdist(normals, normals) < 1e-7, axis=1)


@pytest.mark.parametrize("body", TIED)
def test_what_balances_within_unevenness_is_tied(body: tuple[int, int, float]) -> None:
    points, center = noisy_lattice(*body), np.zeros(3)
    hull = convex_hull(points)
    sides = find_basins(hull, center)
    centers = [side.equilibria.center_of_mass for side in sides]
    for side, moved in zip(sides, centers, strict=True):
        assert side.equilibria.hull is hull
        assert 0.5 * hull.unevenness < np.abs(moved - center).max() < 4.0 * hull.unevenness + 1e-12
    poses = rest_poses(points, center)
    assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    # The hull at tolerance 0 says the same, but for facets that are one to the eye.
    normals, shares = [poses.normals], [poses.probabilities]
    for moved in centers:
        exact = rest_poses(points, moved, coplanar_tolerance=0.0)
        normals.append(exact.normals)
        shares.append(-exact.probabilities / len(centers))
    difference = np.bincount(clustered(np.concatenate(normals)), np.concatenate(shares))
    assert np.abs(difference).max() < 1e-9


@pytest.mark.parametrize("size", [2.0**-20, 1.0, 2.0**20])
@pytest.mark.parametrize("body", BENT)
def test_facets_that_contradict_each_other_are_merged(
    body: tuple[int, int, float], size: float
) -> None:
    points = size * noisy_lattice(*body)
    poses = rest_poses(points, np.zeros(3))
    assert UNEVEN in poses.notes
    assert 0.5 * len(convex_hull(points).normals) < len(poses.hull.normals)
    assert len(poses.hull.normals) < len(convex_hull(points).normals)
    np.testing.assert_array_equal(poses.hull.vertices, points[poses.hull.source])
    assert poses.morse.equilibria.hull is poses.hull
    assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)


def test_where_no_tolerance_helps_facets_are_exactly_flat(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(probabilities, "COPLANAR_WIDENINGS", ())
    points = noisy_lattice(*BENT[0])
    poses = rest_poses(points, np.zeros(3))
    corners = convex_hull(points).vertices
    assert len(poses.hull.normals) == len(convex_hull(corners, 0.0).normals)
    np.testing.assert_array_equal(poses.hull.vertices, points[poses.hull.source])
    assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("noise", [0.0, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16])
@pytest.mark.parametrize("tolerance", [0.0, None])
def test_lattices_never_fail(noise: float, tolerance: float | None) -> None:
    compared = 0
    for seed in range(60):
        points = noisy_lattice(seed, 8 + seed % 13, noise)
        center = None if seed % 2 else np.zeros(3)
        try:
            poses = rest_poses(points, center, coplanar_tolerance=tolerance)
        except OutsideHullError:
            continue
        assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
        assert (poses.probabilities > 0.0).all()
        if tolerance == 0.0 and seed % 12 == 0:
            compared += 1
            assert verdict(measure(Problem(points, center, coplanar_tolerance=0.0))) == OK
    assert compared > 2 or tolerance is None
