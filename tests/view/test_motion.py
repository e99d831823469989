"""Motions start and end at the right poses, and stay above the floor."""

from __future__ import annotations

import numpy as np
import pytest
from common.kernels import compiled_only

import dicedesign as dd
from dicedesign.geometry.meshes.body import make_body
from dicedesign.throws.simulation import throw_film
from dicedesign.view.motion import Motion, SceneFrame, film_motion, release_motion, turn_motion
from dicedesign.view.nodes import direction_on_ray, facet_on_ray
from dicedesign.view.viewed_body import ViewedBody


@pytest.fixture
def viewed() -> ViewedBody:
    points = np.random.default_rng(4).normal(size=(20, 3)) + np.array([3.0, 0.0, 1.0])
    return ViewedBody.of(make_body(points))


def lowest(viewed: ViewedBody, motion: Motion) -> np.ndarray:
    """(f,) height of the lowest corner in each pose."""
    placed = np.einsum("fij,nj->fni", motion.poses[:, :3, :3], viewed.hull.vertices)
    return (placed[..., 2] + motion.poses[:, None, 2, 3]).min(axis=1)


def test_a_released_body_ends_like_the_roll(viewed: ViewedBody) -> None:
    rng = np.random.default_rng(0)
    start = viewed.poses.transforms[0]
    for down in rng.normal(size=(5, 3)):
        motion = release_motion(viewed, start, down / np.linalg.norm(down))
        np.testing.assert_allclose(motion.poses[0], start, atol=1e-9)
        end = dd.roll(viewed.hull.vertices, down)[-1]
        np.testing.assert_allclose(-motion.poses[-1][2, :3], end.down, atol=1e-9)
        np.testing.assert_allclose(
            motion.poses[-1][:2, :3] @ viewed.center + motion.poses[-1][:2, 3], 0.0, atol=1e-9
        )
        assert (np.diff(motion.seconds) >= 0.0).all()
        np.testing.assert_allclose(lowest(viewed, motion), 0.0, atol=1e-6)
        np.testing.assert_array_equal(motion.at(motion.seconds[-1] + 1.0), motion.poses[-1])


def test_a_standing_body_stays(viewed: ViewedBody) -> None:
    pose = viewed.poses.transforms[2]
    np.testing.assert_allclose(release_motion(viewed, pose).poses[-1], pose, atol=1e-9)


def test_a_half_turn_has_small_steps(viewed: ViewedBody) -> None:
    over = np.diag([1.0, -1.0, -1.0, 1.0])
    motion = turn_motion(viewed.hull, np.eye(4), over)
    np.testing.assert_array_equal(motion.poses[-1], over)
    steps = motion.poses[1:, :3, :3] @ motion.poses[:-1, :3, :3].swapaxes(1, 2)
    assert (steps.trace(axis1=1, axis2=2) > 1.0 + 2.0 * np.cos(0.05)).all()


@compiled_only
@pytest.mark.parametrize("has_direction", [False, True])
def test_a_thrown_body_ends_on_its_rest(viewed: ViewedBody, has_direction: bool) -> None:
    down = viewed.poses.normals[1] if has_direction else None
    film = throw_film(viewed.rigid, dd.load_table("board-game"), 3, down)
    motion = film_motion(film, viewed.center)
    if down is not None:
        np.testing.assert_allclose(-motion.poses[0][2, :3], down, atol=1e-6)
    assert film.rest >= 0
    normal = viewed.poses.normals[film.rest]
    assert float(-motion.poses[-1][2, :3] @ normal) > 1.0 - 1e-3
    size = float(np.ptp(viewed.hull.vertices, axis=0).max())
    assert lowest(viewed, motion)[0] > 0.5 * size
    assert abs(lowest(viewed, motion)[-1]) < 0.02 * size


def test_a_ray_hits_the_facet_that_it_enters(viewed: ViewedBody) -> None:
    hull, rng = viewed.hull, np.random.default_rng(1)
    for facet in range(len(hull.normals)):
        point = rng.dirichlet(np.ones(len(hull.polygon(facet)))) @ hull.polygon(facet)
        way = -hull.normals[facet] + 0.2 * rng.normal(size=3)
        entry, position = facet_on_ray(hull, point - 9.0 * way, way)
        # An oblique ray may enter through a neighbor.
        assert abs(hull.heights(position)[entry]) < 1e-9
        assert hull.heights(position).min() > -1e-9
        assert hull.normals[entry] @ way < 0.0


def test_a_ray_hits_the_near_side_of_the_sphere() -> None:
    hit = direction_on_ray(np.array([0.0, -4.0, 0.5]), np.array([0.0, 2.0, 0.0]))
    np.testing.assert_allclose(hit, [0.0, -np.sqrt(0.75), 0.5])
    # One that misses it passes nearest to its top.
    hit = direction_on_ray(np.array([0.0, -4.0, 2.0]), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(hit, [0.0, 0.0, 1.0])


def test_scene_coordinates_are_inverted(viewed: ViewedBody) -> None:
    frame = SceneFrame.of(viewed.hull)
    points = frame.to_scene(viewed.hull.vertices)
    np.testing.assert_allclose(frame.from_scene(points), viewed.hull.vertices, atol=1e-12)
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(1.0)
