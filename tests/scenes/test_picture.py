"""The picture of a room, by its pixels."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from dicedesign.geometry.meshes.body import body_of
from dicedesign.rest.poses import rest_poses
from dicedesign.runtime.arrays import Booleans, Floats
from dicedesign.scenes.picture import room_picture
from dicedesign.scenes.room import Model, PlacedBody, Room


@pytest.fixture(scope="module")
def pixels() -> Floats:
    """(h, w, 3) picture, from 0 to 1, of a prism, and in front of it one of twice the size."""
    models, bodies = [], []
    for number, (x, y, size) in enumerate([(-3.0, 3.0, 1.0), (3.0, -3.0, 2.0)]):
        prism = body_of(trimesh.creation.cylinder(1.0, 2.0, sections=16))
        models.append(Model(f"{number}", Path(f"{number}"), prism, rest_poses(prism)))
        place = np.diag([size, size, size, 1.0])
        place[:3, 3] = x, y, size
        bodies.append(PlacedBody(number, 0, place))
    room = Room(tuple(models), tuple(bodies), (14.0, 14.0))
    with Image.open(io.BytesIO(room_picture(room))) as image:
        return np.asarray(image.convert("RGB")) / 255.0


def bodies_of(pixels: Floats) -> list[Booleans]:
    """Pixels (h, w) of the bodies, one of which is blue and the other orange; the smaller first."""
    is_colored, is_blue = np.ptp(pixels, axis=2) > 0.15, pixels[:, :, 2] > pixels[:, :, 0]
    return sorted([is_colored & is_blue, is_colored & ~is_blue], key=np.sum)


def test_the_camera_looks_from_the_front(pixels: Floats) -> None:
    behind, front = (np.nonzero(body)[0].mean() for body in bodies_of(pixels))
    assert behind < front - 100.0


def test_faces_of_a_coarse_mesh_have_one_tone_each(pixels: Floats) -> None:
    """The top and four of the sides are the most of a body."""
    for body in bodies_of(pixels):
        counts = np.unique(np.round(pixels[body], 2), axis=0, return_counts=True)[1]
        assert np.sort(counts)[-5:].sum() > 0.55 * body.sum()


def test_the_floor_is_darker_beside_bodies(pixels: Floats) -> None:
    """Just below their lowest pixels it is not as bright as farther away."""
    for body in bodies_of(pixels):
        rows, columns = np.nonzero(body)
        row, column = rows.max(), int(columns[rows == rows.max()].mean())
        assert pixels[row + 8, column, 0] < pixels[row + 40, column, 0] - 0.01
