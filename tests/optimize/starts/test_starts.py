"""Starting shapes against the forward model."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign import rest_poses
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.meshes.body import make_body
from dicedesign.optimize.starts.shapes import (
    HENDECAHEDRA,
    hendecahedron,
    mesh_start,
    prism,
    repulsion,
)
from dicedesign.optimize.starts.start import Start


def nearest_angle(directions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Angle from each direction (k, 3) to the nearest normal, exact for small angles."""
    chord = np.linalg.norm(directions[:, None, :] - normals[None, :, :], axis=2).min(axis=1)
    return 2.0 * np.arcsin(chord / 2.0)


@pytest.mark.parametrize(
    ("start", "facets", "rests"),
    [
        *[(prism(sides), 3 * sides, sides) for sides in (3, 6, 12)],
        *[(hendecahedron(kind), 11, 11) for kind in HENDECAHEDRA],
        *[(repulsion(outcomes, seed=3), outcomes, outcomes) for outcomes in (4, 11, 30)],
    ],
)
def test_starts_rest_in_their_directions_only(start: Start, facets: int, rests: int) -> None:
    poses = rest_poses(start.points)
    assert len(poses.hull.normals) == facets
    assert len(poses.normals) == len(start.directions) == rests
    assert nearest_angle(start.directions, poses.normals).max() < 1e-13
    assert nearest_angle(poses.normals, start.directions).max() < 1e-13
    if facets > rests:
        np.testing.assert_allclose(poses.probabilities, 1.0 / rests, atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_a_mesh_start_in_single_precision_keeps_flat_facets_whole(seed: int) -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    box = np.array([(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]) @ turn
    body = make_body(box.astype(np.float32))
    assert body.single_precision
    start = mesh_start(body, 6)
    hull = convex_hull(start.points)
    assert (len(hull.normals), len(hull.vertices)) == (6, 8)
    assert nearest_angle(start.directions, hull.normals).max() < 1e-12
    assert nearest_angle(np.concatenate([turn, -turn]), start.directions).max() < 1e-6
    np.testing.assert_allclose(start.normalize(box), convex_corners(start, box), atol=1e-6)


def convex_corners(start: Start, points: np.ndarray) -> np.ndarray:
    """Corner of the start nearest to each point of the shape's own."""
    offsets = start.normalize(points)[:, None] - start.points
    return start.points[np.argmin((offsets**2).sum(-1), axis=1)]


def test_a_mesh_start_ranks_the_rests_for_a_given_center() -> None:
    points = np.random.default_rng(8).normal(size=(40, 3)) * [3.0, 2.0, 1.0] + [5.0, 0.0, -2.0]
    center = np.array([5.8, 0.4, -2.2])
    start = mesh_start(make_body(points), 3, center)
    poses = rest_poses(points, center)
    np.testing.assert_allclose(start.directions, poses.normals[:3], atol=1e-12)
    moved = rest_poses(start.points, start.normalize(center))
    np.testing.assert_allclose(moved.probabilities, poses.probabilities, atol=1e-10)
    assert np.abs(rest_poses(points).normals[:3] - poses.normals[:3]).max() > 0.1


def test_a_mesh_start_passes_on_notes() -> None:
    corners = np.vstack([np.eye(3), -np.ones((1, 3)), np.eye(3)[:1]])
    assert mesh_start(make_body(corners), 3).notes == (
        "welded 1 points to others at equal positions",
    )


def test_starts_have_the_documented_coordinates() -> None:
    def own(start: Start) -> np.ndarray:
        return start.origin + start.scale * start.points

    corners = own(prism(5, height=2.0, cap=1.0))
    assert np.hypot(corners[:, 0], corners[:, 1]).max() == pytest.approx(1.0)
    assert np.ptp(corners[:, 2]) == pytest.approx(4.0)
    np.testing.assert_allclose(corners[0], [1.0, 0.0, 1.0], atol=1e-15)
    bisymmetric = own(hendecahedron("bisymmetric"))
    np.testing.assert_allclose(bisymmetric.min(axis=0), [-2.0, -2.0, -1.2], atol=1e-12)
    np.testing.assert_allclose(bisymmetric.max(axis=0), [2.0, 2.0, 1.8], atol=1e-12)
    for tangent in (hendecahedron("circus"), repulsion(9, 1)):
        reach = (own(tangent) @ tangent.directions.T).max(axis=0)
        np.testing.assert_allclose(reach, 1.0, atol=1e-12)
