"""The similarity that lays points onto others, against SciPy and against its own definition."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dicedesign.geometry.sphere import Similarity, best_similarity

Floats = NDArray[np.float64]


def clouds(seed: int) -> tuple[Floats, Floats, Floats]:
    """Points, others that are unlike them, and weights."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(30, 3)), rng.normal(size=(30, 3)), rng.uniform(0.0, 2.0, 30)


@pytest.mark.parametrize("seed", range(3))
def test_a_known_similarity_is_found(seed: int) -> None:
    points, _, weights = clouds(seed)
    rotation = Rotation.from_rotvec([1.0, -2.0, 0.5 + seed]).as_matrix()
    known = Similarity(2.5, rotation, np.array([3.0, -1.0, 7.0]))
    found = best_similarity(points, known(points), weights)
    assert found.scale == pytest.approx(known.scale, rel=1e-13)
    np.testing.assert_allclose(found.rotation, known.rotation, atol=1e-13)
    np.testing.assert_allclose(found.shift, known.shift, atol=1e-13)
    np.testing.assert_allclose(known(points[4]), known(points)[4], rtol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_its_rotation_is_that_of_scipy(seed: int) -> None:
    points, onto, weights = clouds(seed)
    parts = weights / weights.sum()
    expected, _ = Rotation.align_vectors(onto - parts @ onto, points - parts @ points, weights)
    found = best_similarity(points, onto, weights)
    np.testing.assert_allclose(found.rotation, expected.as_matrix(), atol=1e-7)
