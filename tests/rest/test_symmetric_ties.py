"""Bodies with small integer coordinates and a symmetry, which balance in many ways: their odds have
the symmetry too."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.errors import DegenerateBodyError, OutsideHullError
from dicedesign.rest.poses import TIED, rest_poses

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
    """All products of some integer matrices."""
    found = {tuple(np.eye(3).ravel())}
    while True:
        products = {
            tuple((g @ np.reshape(m, (3, 3)) + 0.0).ravel()) for m in found for g in generators
        }
        if products <= found:
            return [np.reshape(m, (3, 3)) for m in found]
        found |= products


@pytest.mark.parametrize("name", GENERATORS)
def test_odds_of_symmetric_bodies_are_symmetric(name: str) -> None:
    symmetries = group(GENERATORS[name])
    rng = np.random.default_rng(len(symmetries))
    tied = asked = 0
    while asked < 40:
        seeds = rng.integers(-3, 4, size=(int(rng.integers(1, 5)), 3))
        points = np.unique(np.concatenate([seeds @ m.T for m in symmetries]), axis=0)
        try:
            poses = rest_poses(points, np.zeros(3))
        except (DegenerateBodyError, OutsideHullError):
            continue
        asked += 1
        tied += TIED in poses.notes
        for matrix in GENERATORS[name]:
            cosines = poses.normals @ matrix.T @ poses.normals.T
            assert cosines.max(axis=1) == pytest.approx(1.0, abs=1e-12)
            image = poses.probabilities[np.argmax(cosines, axis=1)]
            np.testing.assert_allclose(image, poses.probabilities, rtol=0.0, atol=1e-13)
    assert tied >= 3
