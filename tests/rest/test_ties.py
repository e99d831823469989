"""Bodies that balance, exactly or within rounding or unevenness, get the mean of both sides."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from dicedesign.errors import DegenerateBodyError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.basins import aside_directions, find_basins
from dicedesign.rest.poses import TIED, UNEVEN, RestPoses, rest_poses
from tests.reference.measurement import OK, measure, verdict
from tests.reference.problem import Problem

BALANCED = [
    [[-1, -1, -1], [0, 0, 0], [0, 1, 0], [1, 0, 0]],
    [[-2, 0, -1], [-2, 1, -2], [-2, 1, -1], [2, -1, 1]],
    [[-1, 0, 0], [0, 0, -1], [0, 1, -1], [1, -1, -1]],
    [[-1, 0, 1], [0, 1, 0], [1, -1, 1], [1, 1, -1]],
]


def by_normal(poses: RestPoses) -> dict[tuple[float, ...], float]:
    return {
        tuple(np.round(normal, 6) + 0.0): float(p)
        for normal, p in zip(poses.normals, poses.probabilities, strict=True)
    }


def test_a_balanced_body_is_the_mean_of_its_neighbors_and_noted() -> None:
    for points in BALANCED:
        poses = rest_poses(points)
        assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
        moves = 1e-9 * aside_directions(poses.hull, poses.center_of_mass)
        sides = [by_normal(rest_poses(points, poses.center_of_mass + move)) for move in moves]
        for normal, p in by_normal(poses).items():
            mean = sum(side.get(normal, 0.0) for side in sides) / len(sides)
            assert p == pytest.approx(mean, abs=1e-3)
    assert any(TIED in rest_poses(points).notes for points in BALANCED)
    cube = np.array(list(product((-1, 1), repeat=3)))
    stones = (np.random.default_rng(seed).normal(size=(4 + seed, 3)) for seed in range(50))
    assert not any(TIED in rest_poses(points).notes for points in (cube, *stones))


def test_a_tie_in_little_room() -> None:
    """The foot of the center of mass on each side facet is on its lower edge. The center is so near
    to the bottom that it moves aside less than usual."""
    square = np.array(list(product((-1.0, 1.0), (-1.0, 1.0), (0.0,))))
    for height in (1.05e-13, 2e-13, 1e-8):
        top = (1.0 + 2.0 * height) * square + [0.0, 0.0, 2.0]
        poses = rest_poses(np.concatenate([square, top]), [0.0, 0.0, height])
        # Half of the moved bodies rest on a side, without the move all or none.
        assert TIED in poses.notes
        sides = poses.probabilities[np.abs(poses.normals[:, 2]) < 0.5]
        assert len(sides) == 4
        assert np.ptp(sides) < 1e-3


HALF = np.diag([-1.0, -1.0, 1.0])
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
THIRD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
MIRROR = np.diag([1.0, 1.0, -1.0])

GENERATORS = {
    "C2": [HALF],
    "Ci": [-np.eye(3)],
    "Cs": [MIRROR],
    "C3": [THIRD],
    "C4": [QUARTER],
    "D4h": [QUARTER, MIRROR, np.diag([1.0, -1.0, 1.0])],
    "T": [THIRD, HALF],
}


def group(generators: list[np.ndarray]) -> list[np.ndarray]:
    """All products of some integer matrices, of up to eight factors."""
    matrices = [np.eye(3)]
    for _ in range(8):
        products = [m @ g for m in matrices for g in generators]
        matrices = list(np.unique([*matrices, *products], axis=0))
    return matrices


@pytest.mark.parametrize("name", GENERATORS)
def test_probabilities_of_symmetric_bodies_are_symmetric(name: str) -> None:
    symmetries = group(GENERATORS[name])
    rng = np.random.default_rng(len(symmetries))
    tied = checked = 0
    while checked < 40:
        seeds = rng.integers(-3, 4, size=(int(rng.integers(1, 5)), 3))
        points = np.unique(np.concatenate([seeds @ m.T for m in symmetries]), axis=0)
        try:
            poses = rest_poses(points, np.zeros(3))
        except (DegenerateBodyError, OutsideHullError):
            continue
        checked += 1
        tied += TIED in poses.notes
        for matrix in GENERATORS[name]:
            cosines = poses.normals @ matrix.T @ poses.normals.T
            assert cosines.max(axis=1) == pytest.approx(1.0, abs=1e-12)
            image = poses.probabilities[np.argmax(cosines, axis=1)]
            np.testing.assert_allclose(image, poses.probabilities, rtol=0.0, atol=1e-13)
    assert tied >= 3


NEARLY_TIED = [(25, 20, 1e-12), (94, 20, 1e-12), (45, 20, 1e-13), (21, 40, 1e-13), (29, 40, 1e-13)]
"""Seed, points and noise of bodies that balance to within the unevenness of their facets, and in
which noise decides nothing once the center of mass is moved by a little more than that."""

BENT = [(24, 20, 1e-11), (31, 40, 1e-11), (120, 40, 1e-11), (236, 20, 1e-11), (149, 20, 1e-12)]
"""Of bodies some facets of which bend by less than that, or are narrower."""


def noisy_lattice(seed: int, count: int, noise: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.integers(-2, 3, size=(count, 3)) + noise * rng.normal(size=(count, 3))


def cluster_numbers(normals: np.ndarray) -> np.ndarray:
    """For each normal the first one that differs by rounding of the corners only."""
    return np.argmax(cdist(normals, normals) < 1e-7, axis=1)


def test_bodies_that_balance_within_unevenness_are_tied() -> None:
    center = np.zeros(3)
    for body in NEARLY_TIED:
        points = noisy_lattice(*body)
        hull = convex_hull(points)
        sides = find_basins(hull, center)
        centers = [side.equilibria.center_of_mass for side in sides]
        for side, moved in zip(sides, centers, strict=True):
            reach = np.abs(moved - center).max()
            assert side.equilibria.hull is hull
            assert 0.5 * hull.unevenness < reach < 4.0 * hull.unevenness + 1e-12
        poses = rest_poses(points, center)
        assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
        # The hull at tolerance 0 gives these probabilities too, except for nearly coplanar facets.
        normals, shares = [poses.normals], [poses.probabilities]
        for moved in centers:
            exact = rest_poses(points, moved, coplanar_tolerance=0.0)
            normals.append(exact.normals)
            shares.append(-exact.probabilities / len(centers))
        difference = np.bincount(cluster_numbers(np.concatenate(normals)), np.concatenate(shares))
        assert np.abs(difference).max() < 1e-9, body


def test_a_body_whose_merged_facets_contradict_each_other_is_taken_as_it_is() -> None:
    noted = 0
    for body, size in product(BENT, (2.0**-20, 1.0, 2.0**20)):
        points = size * noisy_lattice(*body)
        poses = rest_poses(points, np.zeros(3))
        exact = rest_poses(points, np.zeros(3), coplanar_tolerance=0.0)
        normals = np.concatenate([poses.normals, exact.normals])
        shares = np.concatenate([poses.probabilities, -exact.probabilities])
        difference = np.bincount(cluster_numbers(normals), shares)
        assert np.abs(difference).max() < 1e-12, body
        assert len(poses.probabilities) <= len(exact.probabilities)
        noted += UNEVEN in poses.notes
    assert noted == 6


@pytest.mark.parametrize("tolerance", [0.0, None])
def test_lattices_never_fail(tolerance: float | None) -> None:
    compared = 0
    for noise, seed in product((0.0, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16), range(40)):
        points = noisy_lattice(seed, 8 + seed % 13, noise)
        center = None if seed % 2 else np.zeros(3)
        try:
            poses = rest_poses(points, center, coplanar_tolerance=tolerance)
        except OutsideHullError:
            continue
        assert poses.probabilities.sum() == pytest.approx(1.0, abs=1e-12), (noise, seed)
        assert (poses.probabilities > 0.0).all()
        if tolerance == 0.0 and seed % 20 == 0:
            compared += 1
            assert verdict(measure(Problem(points, center, coplanar_tolerance=0.0))) == OK
    assert compared > 8 or tolerance is None
