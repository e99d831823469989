"""The kernels for triangle surfaces agree with NumPy and SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.kernels import compiled_only

from dicedesign.geometry.meshes.orientation import oriented_shells, shells_of
from dicedesign.geometry.solid import is_closed
from dicedesign.kernels import ops as kernels
from dicedesign.runtime.arrays import Integers

pytestmark = compiled_only


def soups() -> list[Integers]:
    """Triangles that meet at random, spheres, pairs of them, and spheres with a hole."""
    rng = np.random.default_rng(0)
    found = []
    for size in range(2, 60):
        corners = rng.integers(0, size, size=(size, 3))
        distinct = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
        if distinct.any():
            found.append(corners[distinct])
    sphere = np.asarray(trimesh.creation.icosphere(subdivisions=2).faces, dtype=np.int64)
    two = np.concatenate([sphere, sphere[:, ::-1] + sphere.max() + 1])
    found += [sphere, two, two[rng.permutation(len(two))], sphere[1:], sphere[:, ::-1]]
    return found


def test_shells_are_the_connected_components(monkeypatch: pytest.MonkeyPatch) -> None:
    for triangles in soups():
        shells = shells_of(triangles)
        monkeypatch.setattr(kernels, "compiled", None)
        np.testing.assert_array_equal(shells, shells_of(triangles))
        monkeypatch.undo()


def test_closed_surfaces_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = []
    for triangles in soups():
        answers.append(is_closed(triangles))
        monkeypatch.setattr(kernels, "compiled", None)
        assert is_closed(triangles) == answers[-1]
        monkeypatch.undo()
    assert answers[-5:] == [True, True, True, False, True]


def test_one_shell_is_never_turned() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=1)
    for faces in (sphere.faces, sphere.faces[:, ::-1]):
        triangles, turned = oriented_shells(np.asarray(sphere.vertices), np.array(faces))
        assert turned == 0
        np.testing.assert_array_equal(triangles, faces)
