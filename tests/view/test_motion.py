"""Motions end at rest above the origin, and stay above the table."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only

import dicedesign as dd
from dicedesign.geometry.meshes.body import make_body
from dicedesign.throws.simulation import throw_film
from dicedesign.view.motion import Motion, film_motion, release_motion
from dicedesign.view.viewed_body import ViewedBody


@pytest.fixture
def viewed() -> ViewedBody:
    points = np.random.default_rng(4).normal(size=(20, 3)) + np.array([3.0, 0.0, 1.0])
    return ViewedBody.of(make_body(points))


def lowest(viewed: ViewedBody, motion: Motion) -> np.ndarray:
    """(f,) height of the lowest corner at each moment."""
    arms = viewed.hull.vertices - viewed.center
    placed = np.einsum("fj,nj->fn", motion.rotations[:, 2], arms)
    return placed.min(axis=1) + motion.positions[:, 2]


def test_a_released_body_ends_like_the_roll(viewed: ViewedBody) -> None:
    rng = np.random.default_rng(0)
    for down in rng.normal(size=(5, 3)):
        motion, rest = release_motion(viewed.poses, down / np.linalg.norm(down))
        end = dd.roll(viewed.hull.vertices, down)[-1]
        np.testing.assert_allclose(viewed.poses.normals[rest], end.down, atol=1e-9)
        np.testing.assert_allclose(-motion.rotations[-1][2], end.down, atol=1e-9)
        np.testing.assert_allclose(-motion.rotations[0][2], down / np.linalg.norm(down), atol=1e-9)
        np.testing.assert_allclose(motion.positions[-1][:2], 0.0, atol=1e-12)
        assert (np.diff(motion.seconds) >= 0.0).all()
        np.testing.assert_allclose(lowest(viewed, motion), 0.0, atol=1e-6)


@compiled_only
@pytest.mark.parametrize("candidates", [1, 25])
def test_a_thrown_body_ends_on_its_rest(viewed: ViewedBody, candidates: int) -> None:
    film = throw_film(viewed.rigid, dd.load_table("board-game"), 3, candidates=candidates)
    motion = film_motion(film)
    assert film.rest >= 0
    normal = viewed.poses.normals[film.rest]
    assert float(-motion.rotations[-1][2] @ normal) > 1.0 - 1e-3
    size = float(np.ptp(viewed.hull.vertices, axis=0).max())
    assert lowest(viewed, motion)[0] > 0.5 * size
    assert abs(lowest(viewed, motion)[-1]) < 0.02 * size
    turned = np.linalg.norm(motion.quaternions, axis=1)
    np.testing.assert_allclose(turned, 1.0, atol=1e-12)
