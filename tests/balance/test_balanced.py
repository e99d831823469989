"""Bodies with a moved center of mass, from a mesh to files."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from common.bodies import box

from dicedesign.balance.balanced import CenterSearch, balance_body
from dicedesign.balance.goals import EqualProbabilities, FewestRests, GivenProbabilities, Standing
from dicedesign.balance.options import BalanceOptions
from dicedesign.errors import InputError
from dicedesign.geometry.meshes.body import Body, make_body
from dicedesign.rest.poses import rest_poses

QUICK = CenterSearch(samples=60, descents=2, steps=20)


def leaning(scale: float = 1.0) -> Body:
    """Leaning box of about 30 x 36 x 48 times a scale."""
    surface = box((30.0, 36.0, 48.0), (14.0, 8.0, 0.0))
    return make_body(scale * surface.points, surface.triangles, "leaning.stl")


def probabilities_of_file(data: bytes, directions: np.ndarray) -> np.ndarray:
    """Probabilities by volume and hull of the file, read by trimesh."""
    mesh = trimesh.load(io.BytesIO(data), file_type="stl")
    poses = rest_poses(mesh.convex_hull.vertices.astype(np.float32), mesh.center_mass)
    near = directions @ poses.normals.T > np.cos(np.radians(5.0))
    return np.asarray(near @ poses.probabilities)


def test_equal_probabilities_by_a_cavity_are_those_of_the_file() -> None:
    balanced = balance_body(
        leaning(), EqualProbabilities(3), BalanceOptions(by="cavity", search=QUICK)
    )
    assert balanced.reached
    assert balanced.wanted is not None
    probabilities = probabilities_of_file(balanced.made.files[""], balanced.directions)
    np.testing.assert_allclose(probabilities, balanced.probabilities, atol=1e-6)
    assert np.ptp(probabilities) <= 2.0 * BalanceOptions().tolerance
    assert np.ptp(balanced.before) > 0.02
    np.testing.assert_allclose(balanced.center, balanced.center_wanted, atol=1e-4)


@pytest.mark.parametrize("by", ["cavity", "infill"])
def test_a_body_stands_better(by: str) -> None:
    goal = Standing(pose=2)
    balanced = balance_body(leaning(), goal, BalanceOptions(by=by, search=QUICK))
    poses = rest_poses(leaning())
    np.testing.assert_allclose(balanced.before, poses.probabilities[1], atol=1e-6)
    assert balanced.probabilities[0] > balanced.before[0] + 0.01
    assert balanced.by == by
    if by == "cavity":
        probabilities = probabilities_of_file(balanced.made.files[""], balanced.directions)
        np.testing.assert_allclose(probabilities, balanced.probabilities, atol=1e-6)


def test_given_probabilities_of_chosen_poses() -> None:
    # The probabilities with another center of mass that a cavity reaches.
    poses = rest_poses(leaning())
    other = rest_poses(leaning(), poses.center_of_mass + np.array([1.0, -1.0, 1.5]))
    near = poses.normals[:3] @ other.normals.T > np.cos(np.radians(5.0))
    wanted = near @ other.probabilities
    goal = GivenProbabilities(tuple(wanted.tolist()), (1, 2, 3))
    balanced = balance_body(leaning(), goal, BalanceOptions(tolerance=1e-5, search=QUICK))
    assert balanced.reached
    probabilities = probabilities_of_file(balanced.made.files[""], poses.normals[:3])
    np.testing.assert_allclose(probabilities, wanted, atol=1e-5)


def test_the_unit_does_not_matter_where_a_size_is_given() -> None:
    search = CenterSearch(samples=10, descents=1, steps=5)
    options = BalanceOptions(by="cavity", size_mm=60.0, search=search)
    balanced = balance_body(leaning(1e-6), Standing(pose=2), options)
    same = balance_body(leaning(), Standing(pose=2), options)
    np.testing.assert_allclose(balanced.probabilities, same.probabilities, atol=1e-4)
    assert np.ptp(balanced.made.body.points, axis=0).max() < 60.0


def test_a_goal_that_no_center_of_mass_reaches() -> None:
    surface = box((30.0, 40.0, 50.0))
    body = make_body(surface.points, surface.triangles, "box.stl")
    balanced = balance_body(body, FewestRests(), BalanceOptions(by="cavity", search=QUICK))
    assert not balanced.reached
    assert (balanced.rests, balanced.rests_before, balanced.rests_at_least) == (6, 6, 6)
    assert any("within reach" in note for note in balanced.notes)


def test_meshes_that_bound_no_solid() -> None:
    surface = box((30.0, 36.0, 48.0))
    opened = make_body(surface.points, surface.triangles[1:], "open.stl")
    with pytest.raises(InputError, match="closed"):
        balance_body(opened, FewestRests())
    with pytest.raises(InputError, match="point cloud"):
        balance_body(make_body(surface.points, None, "cloud.xyz"), FewestRests())
    with pytest.raises(InputError, match=r"size .* mm, got .*--size-mm"):
        balance_body(leaning(1e-6), FewestRests())
