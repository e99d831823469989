"""Hidden hollows: the center of mass by another library, walls, and bodies without room."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from dicedesign.errors import EngravingError
from dicedesign.fabricate.convex_object import WALL, hollow_out
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.manifold import mesh_of, solid
from dicedesign.geometry.triangles import Surface


def cube(size: float) -> Surface:
    half = size / 2.0
    hull = convex_hull(
        np.array(np.meshgrid([-half, half], [-half, half], [-half, half])).reshape(3, -1).T
    )
    return Surface(hull.vertices, hull.triangles)


def with_pocket(size: float, side: float, depth: float) -> Surface:
    """A cube with a square pocket in its upper side."""
    plain, tool = cube(size), cube(side)
    shift = np.array([0.0, 0.0, size / 2.0 + side / 2.0 - depth])
    body = solid(plain.points, plain.triangles) - solid(tool.points + shift, tool.triangles)
    return Surface(*mesh_of(body))


def test_the_center_of_mass_is_back() -> None:
    body = with_pocket(20.0, 8.0, 0.6)
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
    # As small as it can be: a smaller one would have to lie farther out, in the wall.
    assert radius == pytest.approx(1.0, abs=1e-6) or middle[2] - radius < -10.0 + WALL + 0.5


def test_nothing_to_balance() -> None:
    body = cube(20.0)
    assert hollow_out(body, np.zeros(3)) is body


def test_no_room() -> None:
    with pytest.raises(EngravingError, match="balance: expected room"):
        hollow_out(with_pocket(6.0, 5.0, 2.0), np.zeros(3))
