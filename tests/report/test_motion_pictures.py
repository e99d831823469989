"""Pictures of motions: where the die is in throws and that it moves, and rolls moment by moment."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
import trimesh
from common.drawings import is_whole
from PIL import Image
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.report.figures import MOST_TRIANGLES, surface_to_draw
from dicedesign.report.motion_pictures import (
    MOMENTS,
    FilmedDie,
    drop_figure,
    film_figure,
    moving_picture,
)
from dicedesign.rest.poses import RestPoses, rest_poses
from dicedesign.rest.roll import RollStep, roll_steps
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


def filmed(film: Film) -> FilmedDie:
    return FilmedDie(film, CUBE, convex_hull(CUBE).triangles, CENTER)


def falling(frames: int, height: float = 0.1) -> Film:
    """From the left to the right and from the back to the front, while it falls to the table."""
    way = np.linspace(0.0, 1.0, frames)[:, None]
    return film_of(way * [0.16, 0.0, -height] + [0.3, 0.5, height + 0.015], 8.0)


def colored(picture: np.ndarray) -> tuple[float, float, float]:
    """Middle column and middle row of the die's color, which is no gray, and its width."""
    rows, columns = np.nonzero(np.ptp(picture.astype(int), axis=2) > 12)
    middles = (columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2
    return *middles, float(np.ptp(columns) + 1)


def frames_of(gif: bytes) -> tuple[list[np.ndarray], list[int], Image.Image]:
    image = Image.open(BytesIO(gif))
    pictures, durations = [], []
    for k in range(image.n_frames):
        image.seek(k)
        pictures.append(np.asarray(image.convert("RGB")))
        durations.append(image.info["duration"])
    return pictures, durations, image


@pytest.mark.parametrize(("height", "columns"), [(0.1, 10), (0.03, 5)])
def test_strip_shows_heights_and_times(height: float, columns: int) -> None:
    film = falling(31, height)
    figure = film_figure(filmed(film))
    assert len(figure.pictures) == 10
    titles = figure.texts
    assert titles[0] == "0.00 s"
    assert titles[-1] == "0.30 s"
    assert titles == sorted(set(titles))
    unit = 1.2 * TABLE.size / (1800 // columns)
    for picture, title in zip(figure.pictures, titles, strict=True):
        assert picture.shape[1] == 1800 // columns
        column, row, _ = colored(picture)
        assert column == pytest.approx(picture.shape[1] / 2, abs=2.0)
        # The table's front edge is two radii before its middle, which is under the die.
        front = np.flatnonzero((picture[:, 0] < 200).all(axis=1))[0]
        z = film.positions[round(100 * float(title[:-2])), 2]
        above = np.cos(RISE) * z + np.sin(RISE) * TABLE.size
        assert front - row == pytest.approx(above / unit, abs=2.5)
    assert figure.png() == film_figure(filmed(film)).png()


def test_moving_picture() -> None:
    film = falling(31)
    gif = moving_picture(filmed(film))
    assert gif == moving_picture(filmed(film))
    pictures, durations, image = frames_of(gif)
    assert image.info["loop"] == 0
    assert durations == [40] * 30 + [2000]
    assert image.width == 480
    places = np.array([colored(picture) for picture in pictures])
    unit = (0.16 + 1.2 * TABLE.size) / 480
    expected = (film.positions - film.positions.mean(axis=0)) / unit
    middles = places[:, :2] - places[:, :2].mean(axis=0)
    np.testing.assert_allclose(middles[:, 0], expected[:, 0], atol=2.0)
    np.testing.assert_allclose(middles[:, 1], -np.cos(RISE) * expected[:, 2], atol=3.0)


def test_a_long_film_is_thinned() -> None:
    film = falling(160)
    pictures, _, _ = frames_of(moving_picture(filmed(film)))
    assert len(pictures) == 150
    assert colored(pictures[0])[0] < 60
    assert colored(pictures[-1])[0] > 420


def test_a_die_that_does_not_move_is_seen() -> None:
    film = film_of(np.full((3, 3), [0.0, 0.0, 0.015]), 0.0)
    pictures, _, _ = frames_of(moving_picture(filmed(film)))
    assert colored(pictures[0])[0] == pytest.approx(240.0, abs=1.0)
    assert len(film_figure(filmed(film)).pictures) == 2


def rolled(mesh: trimesh.Trimesh, down: list[float]) -> tuple[RestPoses, tuple[RollStep, ...]]:
    poses = rest_poses(mesh)
    return poses, roll_steps(poses.morse.equilibria, down)


def test_a_falling_tower_is_shown_from_corner_to_side() -> None:
    mesh = trimesh.creation.box((1.0, 1.2, 4.0))
    poses, steps = rolled(mesh, [0.5, 0.2, 0.6])
    surface = surface_to_draw(mesh.vertices, mesh.faces, poses.hull)
    figure = drop_figure(surface, poses, steps[0].down)
    assert is_whole(figure)
    grid, sphere = figure.pictures
    assert grid.shape[0] > 250
    assert sphere.shape[1] > 1000
    ink = (grid[70:] < 200).any(axis=(0, 2))
    starts = np.flatnonzero(ink[1:] & ~ink[:-1])
    # As many bodies side by side as the contact changed.
    assert len(starts) == len(steps)


def test_a_roll_of_many_contacts_is_shown_in_few_pictures() -> None:
    points = np.random.default_rng(1).normal(size=(300, 3))
    mesh = trimesh.convex.convex_hull(points / np.linalg.norm(points, axis=1, keepdims=True))
    mesh.vertices[:, 2] *= 2.0
    mesh = trimesh.convex.convex_hull(mesh.vertices)
    poses, steps = rolled(mesh, [0.1, 0.05, 1.0])
    assert len(steps) > MOMENTS
    surface = surface_to_draw(mesh.vertices, mesh.faces, poses.hull)
    figure = drop_figure(surface, poses, steps[0].down)
    assert figure.pictures[0].shape[1] <= 5 * 324 + 24
    assert figure.png() == drop_figure(surface, poses, steps[0].down).png()


def test_a_body_at_rest_is_one_picture() -> None:
    mesh = trimesh.creation.box((1.0, 1.2, 4.0))
    poses, steps = rolled(mesh, [1.0, 0.0, 0.0])
    assert len(steps) == 1
    surface = surface_to_draw(mesh.vertices, mesh.faces, poses.hull)
    assert is_whole(drop_figure(surface, poses, steps[0].down))


def test_what_is_drawn_of_points_and_of_too_many_triangles_is_the_hull() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    hull = rest_poses(mesh.vertices).hull
    for triangles in (None, np.zeros((MOST_TRIANGLES + 1, 3), dtype=np.int64)):
        assert surface_to_draw(mesh.vertices, triangles, hull).points is hull.vertices
    assert surface_to_draw(mesh.vertices, mesh.faces, hull).points is mesh.vertices
