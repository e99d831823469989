"""Triangles are oriented consistently and outward, freed of duplicates, and grouped in shells."""

from __future__ import annotations

import numpy as np
import trimesh
from common.kernels import compiled_only, without_kernels

from dicedesign.geometry.meshes.body import distinct_triangles, outward_patches, shells_of
from dicedesign.geometry.triangles import is_closed
from dicedesign.runtime.arrays import Integers


def soups() -> list[Integers]:
    """Triangles that meet at random, spheres, pairs of them, and spheres with a hole."""
    rng = np.random.default_rng(0)
    soups_of_triangles = []
    for size in range(2, 60):
        corners = rng.integers(0, size, size=(size, 3))
        distinct = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
        if distinct.any():
            soups_of_triangles.append(corners[distinct])
    sphere = np.asarray(trimesh.creation.icosphere(subdivisions=2).faces, dtype=np.int64)
    two = np.concatenate([sphere, sphere[:, ::-1] + sphere.max() + 1])
    soups_of_triangles += [sphere, two, two[rng.permutation(len(two))], sphere[1:], sphere[:, ::-1]]
    return soups_of_triangles


@compiled_only
def test_kernels_find_the_shells_and_the_closed_surfaces_that_numpy_finds() -> None:
    answers = []
    for triangles in soups():
        shells = shells_of(triangles)
        answers.append(is_closed(triangles))
        with without_kernels():
            np.testing.assert_array_equal(shells, shells_of(triangles))
            assert is_closed(triangles) == answers[-1]
    assert answers[-5:] == [True, True, True, False, True]


SPHERE = trimesh.creation.icosphere(subdivisions=2)
POINTS = np.asarray(SPHERE.vertices)
OUTWARD = np.asarray(SPHERE.faces, dtype=np.int64)


def rows(triangles: np.ndarray) -> set[tuple[int, ...]]:
    """Triangles, from their lowest corner on."""
    turned = [np.roll(row, -int(row.argmin())) for row in triangles]
    return {tuple(int(corner) for corner in row) for row in turned}


def test_one_of_repeated_triangles_is_kept_whatever_its_first_corner() -> None:
    rng = np.random.default_rng(0)
    again = np.roll(OUTWARD[rng.integers(0, len(OUTWARD), 500)], 1, axis=1)
    mixed = rng.permutation(np.concatenate([OUTWARD, again]))
    distinct = distinct_triangles(mixed)
    assert len(distinct) == len(OUTWARD)
    assert rows(distinct) == rows(OUTWARD)


def test_double_walls_are_removed_and_triangles_with_more_copies_on_one_side_stay() -> None:
    wall = np.array([[0, 5, 9]])
    mixed = np.concatenate([wall, OUTWARD, wall[:, ::-1], OUTWARD[:3, ::-1], OUTWARD[:3]])
    assert rows(distinct_triangles(mixed)) == rows(OUTWARD)


def test_a_surface_with_two_sides_keeps_one() -> None:
    both = np.concatenate([OUTWARD, OUTWARD[:, ::-1]])
    assert rows(distinct_triangles(both[:-4])) == rows(OUTWARD)


def test_closed_and_nearly_closed_patches_are_turned_outward() -> None:
    shells = [POINTS, 0.5 * POINTS, POINTS + np.array([3.0, 0.0, 0.0])]
    count = len(POINTS)
    triangles = np.concatenate([OUTWARD, OUTWARD[:, ::-1] + count, OUTWARD[2:, ::-1] + 2 * count])
    reversed_too = np.random.default_rng(1).random(len(triangles)) < 0.1
    given = np.where(reversed_too[:, None], triangles[:, ::-1], triangles)
    turned = outward_patches(np.concatenate(shells), given)
    wanted = np.concatenate([OUTWARD, OUTWARD + count, OUTWARD[2:] + 2 * count])
    assert rows(turned) == rows(wanted)
    assert is_closed(turned[: 2 * len(OUTWARD)])
