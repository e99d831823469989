"""Bodies that went through a binary STL file, and so through float32, rest as they did before."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dicedesign import read_body, rest_poses
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.geometry.meshes.reading import stl_bytes
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.optimize.starts.shapes import hendecahedron
from dicedesign.optimize.targets import sum_of_dice
from dicedesign.rest.poses import RestPoses
from tests.reference import solids

TOLERANCE = 1e-5

RESTS = {"cube": 6, "dodecahedron": 12, "prism": 14, "die": 11}


@cache
def body(name: str) -> ConvexHull:
    """A solid of circumradius 1 in float64; the die is on its way to the probabilities of two
    dice."""
    if name == "die":
        start, target = hendecahedron("circus"), sum_of_dice([6, 6]).probabilities
        options = ExactOptions(prefer=Preferences())
        return solve_exact(shapes_like(start, 0), target, options).hull
    points = (solids.prism(12) if name == "prism" else solids.platonic(name)).points
    return convex_hull(points / np.sqrt((points[0] ** 2).sum()))


def compare(path: Path, before: RestPoses, rests: int) -> None:
    """Compare the rests of a file with the rests of the float64 body, one by one."""
    read = read_body(path)
    assert read.single_precision
    after = rest_poses(read)
    assert after.center_of_mass_source == "uniform solid"
    assert len(after.normals) == len(before.normals) == rests
    distances = np.abs(after.normals[None] - before.normals[:, None]).max(-1)
    image = distances.argmin(axis=1)
    assert sorted(image) == list(range(rests))
    np.testing.assert_allclose(after.normals[image], before.normals, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(
        after.probabilities[image], before.probabilities, rtol=0, atol=TOLERANCE
    )


@pytest.mark.parametrize("offset", [0.0, 0.4, 3.0])
@pytest.mark.parametrize("radius", [0.01, 17.3, 250.0])
@pytest.mark.parametrize("turn", [None, 1, 2, 3])
@pytest.mark.parametrize("name", RESTS)
def test_an_stl_rests_as_its_source(
    name: str, turn: int | None, radius: float, offset: float, tmp_path: Path
) -> None:
    hull = body(name)
    matrix = np.eye(3) if turn is None else Rotation.random(random_state=turn).as_matrix()
    place = offset * radius * np.array([0.3, -0.5, 0.81])
    points = radius * hull.vertices @ matrix.T + place
    path = tmp_path / "body.stl"
    path.write_bytes(stl_bytes(hull.surface.with_points(points)))
    compare(path, rest_poses(points), RESTS[name])
