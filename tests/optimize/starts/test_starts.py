"""Starting shapes against the forward model."""

from __future__ import annotations

import re

import numpy as np
import pytest

from dicedesign import rest_poses
from dicedesign.errors import InputError
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


@pytest.mark.parametrize("sides", [3, 6, 12])
def test_a_prism_rests_on_its_sides_only(sides: int) -> None:
    start = prism(sides)
    poses = rest_poses(start.points)
    assert len(poses.hull.normals) == 3 * sides
    assert len(poses.normals) == sides
    np.testing.assert_allclose(poses.probabilities, 1.0 / sides, atol=1e-12)
    assert start.directions.shape == (sides, 3)
    assert nearest_angle(start.directions, poses.normals).max() < 1e-14
    assert nearest_angle(poses.normals, start.directions).max() < 1e-14


@pytest.mark.parametrize("kind", sorted(HENDECAHEDRA))
def test_a_hendecahedron_has_eleven_rests_in_its_directions(kind: str) -> None:
    start = hendecahedron(kind)
    poses = rest_poses(start.points)
    assert len(poses.hull.normals) == 11
    assert len(poses.normals) == 11
    assert start.directions.shape == (11, 3)
    np.testing.assert_allclose(np.linalg.norm(start.directions, axis=1), 1.0, atol=1e-15)
    assert nearest_angle(start.directions, poses.normals).max() < 1e-14
    assert nearest_angle(poses.normals, start.directions).max() < 1e-14


@pytest.mark.parametrize("outcomes", [4, 11, 30])
def test_repulsion_gives_one_stable_facet_for_each_outcome(outcomes: int) -> None:
    start = repulsion(outcomes, seed=3)
    poses = rest_poses(start.points)
    assert len(poses.hull.normals) == outcomes
    assert len(poses.normals) == outcomes
    assert nearest_angle(start.directions, poses.normals).max() < 1e-13


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
    with pytest.raises(InputError, match="got 6 in points"):
        mesh_start(body, 7)


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


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: prism(2), "start.prism.sides: expected 3 to 12, got 2"),
        (lambda: prism(4, 0.0), "start.prism.height: expected a positive number, got 0"),
        (
            lambda: prism(4, 1.0, float("inf")),
            "start.prism.cap: expected a number not below 0, got inf; leave it out for 1.3",
        ),
        (
            lambda: hendecahedron("cube"),
            "start.hendecahedron: expected one of bisymmetric, circus, got 'cube'",
        ),
        (
            lambda: repulsion(3, 0),
            "start.repulsion: expected at least 4 outcomes, got 3; a body bounded by fewer "
            "facets does not exist, start from a prism",
        ),
        (
            lambda: mesh_start(make_body(np.vstack([np.eye(3), -np.ones((1, 3))])), 5),
            "start.mesh: expected a body with at least 5 rests, one for each outcome, got ",
        ),
    ],
)
def test_bad_starts_are_refused_in_words(make, text: str) -> None:
    with pytest.raises(InputError, match=re.escape(text)):
        make()
