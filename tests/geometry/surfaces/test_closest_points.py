"""Closest points against trimesh, samples of the surface and cases by hand."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere

from dicedesign.geometry.surfaces.closest_points import closest_points, closest_weights
from dicedesign.geometry.surfaces.surface import Surface

TRIANGLE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]])


@pytest.mark.parametrize(
    ("point", "weights"),
    [
        ([0.5, 0.5, 3.0], [0.5, 0.25, 0.25]),
        ([-1.0, -2.0, 1.0], [1.0, 0.0, 0.0]),
        ([5.0, -1.0, 0.0], [0.0, 1.0, 0.0]),
        ([-1.0, 4.0, 2.0], [0.0, 0.0, 1.0]),
        ([0.5, -1.0, 1.0], [0.75, 0.25, 0.0]),
        ([2.0, 2.0, -1.0], [0.0, 0.5, 0.5]),
        ([-3.0, 0.5, 0.0], [0.75, 0.0, 0.25]),
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
    ],
)
def test_faces_edges_and_corners(point: list[float], weights: list[float]) -> None:
    found = closest_weights(np.array([point]), TRIANGLE[None])
    np.testing.assert_allclose(found[0], weights, atol=1e-15)


def test_flat_triangles_are_segments_or_points() -> None:
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    weights = closest_weights(np.array([[2.5, 1.0, 0.0]]), line[None])[0]
    np.testing.assert_allclose(weights @ line, [2.5, 0.0, 0.0], atol=1e-15)
    dot = np.ones((3, 3))
    np.testing.assert_allclose(closest_weights(np.zeros((1, 3)), dot[None])[0] @ dot, np.ones(3))


@pytest.mark.parametrize("surface", [bumpy_sphere(), bent_capsule()])
def test_surfaces_against_all_triangles_by_trimesh(surface: Surface) -> None:
    rng = np.random.default_rng(6)
    spread = 0.4 * surface.diagonal * rng.normal(size=(200, 3))
    points = np.concatenate([surface.centroid + spread, surface.points[:50]])
    found = closest_points(surface, points)
    corners, count = surface.points[surface.triangles], len(surface.triangles)
    for point, distance in zip(points, found.distances, strict=True):
        repeated = np.repeat(point[None], count, axis=0)
        feet = trimesh.triangles.closest_point(corners, repeated)
        assert distance == pytest.approx(np.linalg.norm(feet - point, axis=1).min(), abs=1e-12)
    assert (found.weights >= 0.0).all()
    np.testing.assert_allclose(found.weights.sum(axis=1), 1.0, atol=1e-14)
    means = (found.weights[:, :, None] * surface.points[found.corners]).sum(axis=1)
    np.testing.assert_allclose(means, found.points, atol=1e-14 * surface.diagonal)
    np.testing.assert_allclose(
        found.matrix(len(surface.points)) @ surface.points, found.points, atol=1e-13
    )
    np.testing.assert_allclose(np.linalg.norm(means - points, axis=1), found.distances, atol=1e-12)


def test_no_point_of_an_uneven_surface_is_nearer() -> None:
    """Long thin triangles beside small ones, where a triangle's middle says little."""
    surface = bumpy_sphere()
    stretched = surface.moved(surface.points * np.array([50.0, 1.0, 0.02]))
    rng = np.random.default_rng(7)
    corners = stretched.points[stretched.triangles]
    points = stretched.points.mean(axis=0) + np.ptp(stretched.points, axis=0) * rng.normal(
        size=(30, 3)
    )
    found = closest_points(stretched, points)
    samples = rng.dirichlet(np.ones(3), size=200)
    everywhere = np.einsum("sk,tkj->stj", samples, corners).reshape(-1, 3)
    for point, distance in zip(points, found.distances, strict=True):
        assert distance <= np.linalg.norm(everywhere - point, axis=1).min()
