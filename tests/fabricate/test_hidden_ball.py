"""Hidden hollows: the center of mass by another library, walls, and bodies without room."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from dicedesign.errors import EngravingError
from dicedesign.fabricate.convex_object import WALL, hollow_out
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.triangles import Surface


@pytest.fixture
def cube_with_pocket(box):
    """Make a cube with a square pocket in its upper side."""

    def make(size: float, side: float, depth: float) -> Surface:
        plain, tool = box(size, size, size), box(side, side, side)
        shift = np.array([0.0, 0.0, size / 2.0 + side / 2.0 - depth])
        body = solid(plain.surface) - solid(tool.surface.with_points(tool.vertices + shift))
        return mesh_of(body)

    return make


def test_the_center_of_mass_returns_to_its_place(cube_with_pocket) -> None:
    body = cube_with_pocket(20.0, 8.0, 0.6)
    assert abs(body.centroid[2]) > 0.03
    end = hollow_out(body, np.zeros(3))
    judge = trimesh.Trimesh(end.points, end.triangles, process=False)
    np.testing.assert_allclose(judge.center_mass, np.zeros(3), atol=1e-12)
    assert judge.is_watertight
    hollow = end.points[len(body.points) :]
    assert hollow[:, 2].max() < 0.0
    middle, radius = hollow.mean(axis=0), np.linalg.norm(hollow - hollow.mean(axis=0), axis=1).max()
    assert radius >= 1.0
    assert middle[2] - radius > -10.0 + WALL - 1e-9
    # A smaller hollow would have to be farther out, in the wall.
    assert radius == pytest.approx(1.0, abs=1e-6) or middle[2] - radius < -10.0 + WALL + 0.5


def test_a_balanced_body_is_unchanged(box) -> None:
    body = box(20.0, 20.0, 20.0).surface
    assert hollow_out(body, np.zeros(3)) is body


def test_a_body_without_room_is_refused(cube_with_pocket) -> None:
    with pytest.raises(EngravingError, match="balance: expected room"):
        hollow_out(cube_with_pocket(6.0, 5.0, 2.0), np.zeros(3))
