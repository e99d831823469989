"""Moving pictures of throws, and rolls moment by moment."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
import trimesh
from common.drawings import is_whole, pictures
from PIL import Image
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.report import motion_pictures
from dicedesign.report.body_figures import MAX_TRIANGLES, surface_to_draw
from dicedesign.report.motion_pictures import drop, moving_picture
from dicedesign.report.sheet import Sheet
from dicedesign.rest.poses import rest_poses
from dicedesign.rest.roll import roll_steps
from dicedesign.throws.rigid_body import rigid_body
from dicedesign.throws.simulation import Film
from dicedesign.throws.tables import Table

CENTER = np.array([7.0, -3.0, 2.0])
CUBE = 10.0 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) + CENTER
TABLE = Table("test", restitution=0.5, friction=0.3, height=0.1, speed=0.2, spin=10.0, size=0.03)
RISE = np.radians(18.0)


def film_of(positions: np.ndarray, spin: float) -> Film:
    """A cube on a path, turning about y at a rate in rad/s."""
    seconds = np.arange(len(positions)) / 100.0
    turns = Rotation.from_rotvec(np.outer(spin * seconds, [0.0, 1.0, 0.0]))
    body = make_body(CUBE)
    thrown = rigid_body(body, rest_poses(body))
    return Film(thrown, TABLE, seconds, positions, turns.as_quat(scalar_first=True), 0)


def gif_of(film: Film) -> bytes:
    return moving_picture(film, convex_hull(CUBE).surface, CENTER)


def falling(frames: int) -> Film:
    """Fall to the table while it moves to the right."""
    way = np.linspace(0.0, 1.0, frames)[:, None]
    return film_of(way * [0.16, 0.0, -0.1] + [0.3, 0.5, 0.115], 8.0)


def middle_of_die(picture: np.ndarray) -> tuple[float, float]:
    """Middle column and middle row of the die, which alone is not gray."""
    rows, columns = np.nonzero(np.ptp(picture.astype(int), axis=2) > 12)
    return (columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2


def frames_of(gif: bytes) -> tuple[list[np.ndarray], list[int], Image.Image]:
    image = Image.open(BytesIO(gif))
    frames, durations = [], []
    for k in range(image.n_frames):
        image.seek(k)
        frames.append(np.asarray(image.convert("RGB")))
        durations.append(image.info["duration"])
    return frames, durations, image


def test_the_film_follows_the_die() -> None:
    film = falling(31)
    gif = gif_of(film)
    assert gif == gif_of(film)
    frames, durations, image = frames_of(gif)
    assert image.info["loop"] == 0
    assert durations == [40] * 30 + [2000]
    places = np.array([middle_of_die(picture) for picture in frames])
    unit = (0.16 + 1.2 * TABLE.size) / image.width
    expected = (film.positions - film.positions.mean(axis=0)) / unit
    middles = places - places.mean(axis=0)
    np.testing.assert_allclose(middles[:, 0], expected[:, 0], atol=2.0)
    np.testing.assert_allclose(middles[:, 1], -np.cos(RISE) * expected[:, 2], atol=3.0)


def test_a_long_film_is_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_pictures, "MAX_FRAMES", 10)
    frames, _, _ = frames_of(gif_of(falling(16)))
    assert len(frames) == 10
    assert middle_of_die(frames[0])[0] < 60
    assert middle_of_die(frames[-1])[0] > 420


def test_of_a_long_slide_the_end_is_shown() -> None:
    """And a die that does not move."""
    way = np.linspace(0.0, 1.0, 101)[:, None]
    frames, _, _ = frames_of(gif_of(film_of(way * [1.2, 0.0, 0.0] + [0.0, 0.0, 0.015], 0.0)))
    # Sixteen radii of 15 mm.
    assert len(frames) == 1 + 20
    columns = np.nonzero(np.ptp(frames[-1].astype(int), axis=2) > 12)[1]
    assert np.ptp(columns) > 25
    frames, _, _ = frames_of(gif_of(film_of(np.full((3, 3), [0.0, 0.0, 0.015]), 0.0)))
    assert middle_of_die(frames[0])[0] == pytest.approx(240.0, abs=1.0)


def draw_roll(mesh: trimesh.Trimesh, down: list[float]) -> tuple[Sheet, int]:
    """Figure of a roll, and the number of its contacts."""
    poses = rest_poses(mesh)
    steps = roll_steps(poses.morse.equilibria, down)
    surface = surface_to_draw(mesh.vertices, mesh.faces, poses.hull)
    return drop(surface, poses, steps[0].down), len(steps)


@pytest.mark.parametrize("down", [[0.5, 0.2, 0.6], [1.0, 0.0, 0.0]])
def test_a_tower_is_shown_at_each_contact(down: list[float]) -> None:
    """It falls from a corner, or is at rest."""
    figure, count = draw_roll(trimesh.creation.box((1.0, 1.2, 4.0)), down)
    assert is_whole(figure)
    assert (count == 1) == (down[0] == 1.0)
    assert len(pictures(figure)) == count
    assert all((picture < 200).any() for picture in pictures(figure))


def test_a_roll_of_many_contacts_is_shown_in_few_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_pictures, "MAX_MOMENTS", 5)
    points = np.random.default_rng(1).normal(size=(60, 3))
    points *= [[1.0, 1.0, 2.0]] / np.linalg.norm(points, axis=1, keepdims=True)
    figure, count = draw_roll(trimesh.convex.convex_hull(points), [0.1, 0.05, 1.0])
    assert count > 5
    assert len(pictures(figure)) <= 5


def test_the_hull_is_drawn_for_points_and_for_too_many_triangles() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    hull = rest_poses(mesh.vertices).hull
    for triangles in (None, np.zeros((MAX_TRIANGLES + 1, 3), dtype=np.int64)):
        assert surface_to_draw(mesh.vertices, triangles, hull).points is hull.vertices
    assert surface_to_draw(mesh.vertices, mesh.faces, hull).points is mesh.vertices
