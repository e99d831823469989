"""The similarity that lays points onto others, against SciPy and against its own definition."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dicedesign.geometry.procrustes import Similarity, best_similarity

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


def test_no_other_is_better() -> None:
    points, onto, weights = clouds(7)
    best = best_similarity(points, onto, weights)

    def cost(similarity: Similarity) -> float:
        return float(weights @ ((similarity(points) - onto) ** 2).sum(axis=1))

    rng = np.random.default_rng(8)
    for size in (1e-4, 1e-2, 1.0):
        for _ in range(20):
            turn = Rotation.from_rotvec(size * rng.normal(size=3)).as_matrix() @ best.rotation
            shift = best.shift + size * rng.normal(size=3)
            scale = best.scale * np.exp(size * rng.normal())
            assert cost(Similarity(scale, turn, shift)) > cost(best)


def test_a_mirror_image_is_not_mirrored() -> None:
    points, _, weights = clouds(9)
    found = best_similarity(points, points * np.array([1.0, 1.0, -1.0]), weights)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0, abs=1e-13)
    assert 0.0 < found.scale < 1.0
