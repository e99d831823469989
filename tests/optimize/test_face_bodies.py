"""Solids of many faces for few outcomes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import HalfspaceIntersection
from scipy.spatial.distance import pdist

from dicedesign import rest_poses
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.starts.face_bodies import (
    equal_faces_body,
    numbers_of_equal_faces,
    share_faces,
)

NUMBERS = [4, *range(6, 35, 2), 48, 60, 120]


def test_numbers_of_equal_faces() -> None:
    assert [n for n in range(1, 130) if equal_faces_body(n) is not None] == NUMBERS
    assert numbers_of_equal_faces(np.array([1 / 4, 3 / 4])) == [8, 12, 16, 20, 24, 28, 48, 60, 120]
    # Narrow faces are for dice that no other body makes as right.
    assert numbers_of_equal_faces(np.full(17, 1 / 17)) == [34]
    assert numbers_of_equal_faces(np.array([1 / 34, 33 / 34])) == []


@pytest.mark.parametrize("faces", NUMBERS)
def test_equal_faces_are_congruent_and_equally_probable(faces: int) -> None:
    """The corners are those that Qhull finds; polygons with the same distances between their
    corners are congruent."""
    body = equal_faces_body(faces)
    assert body is not None
    normals = body.normals
    assert normals.shape == (faces, 3)
    planes = np.column_stack([normals, -np.ones(faces)])
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections
    corners = corners[np.unique(corners.round(6), axis=0, return_index=True)[1]]
    distances = [np.sort(pdist(corners[corners @ normal > 1.0 - 1e-9])) for normal in normals]
    np.testing.assert_allclose(distances, np.broadcast_to(distances[0], (faces, len(distances[0]))))
    poses = rest_poses(corners)
    np.testing.assert_allclose(poses.probabilities, np.full(faces, 1.0 / faces), atol=1e-12)
    cosines = normals @ normals.T
    assert (np.abs(cosines.min(axis=1) + 1.0) < 1e-12).all() == (faces != 4)
    if body.group is not None:
        images = normals[0] @ point_group(body.group).transpose(0, 2, 1)
        assert ((images @ normals.T).max(axis=0) > 1.0 - 1e-9).all()


def test_faces_are_shared_in_opposite_pairs() -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        target = rng.dirichlet(np.full(rng.integers(2, 9), 2.0))
        faces = 2 * int(rng.integers(6, 25))
        shared = share_faces(target, faces)
        counts = np.bincount(shared.outcome, minlength=len(target))
        assert counts.sum() == faces
        np.testing.assert_allclose(shared.shares, (target / counts)[shared.outcome], rtol=1e-14)
        # Outcomes with an odd number of faces, and no others, share one pair each with another.
        first, second = np.split(shared.outcome, 2)
        mixed = np.sort(np.concatenate([first, second])[np.tile(first != second, 2)])
        assert mixed.tolist() == np.flatnonzero(counts % 2).tolist()
    whole = share_faces(np.array([1, 2, 3, 6]) / 12, 24)
    assert (whole.cost, np.ptp(whole.shares) < 1e-15) == (0.0, True)
