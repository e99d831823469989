"""Distances from surfaces, against trimesh, samples of the surface and cases by hand."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from common.bumpy import bent_capsule, bumpy_sphere

from dicedesign.geometry.surfaces.distances import (
    closest_points,
    distances_from_surface,
    distances_from_triangles,
)
from dicedesign.geometry.surfaces.surface import Surface

TRIANGLE = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
LINE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [4.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("corners", "point", "closest"),
    [
        (TRIANGLE, [0.5, 0.5, 3.0], [0.5, 0.5, 0.0]),
        (TRIANGLE, [-1.0, -2.0, 1.0], [0.0, 0.0, 0.0]),
        (TRIANGLE, [5.0, -1.0, 0.0], [2.0, 0.0, 0.0]),
        (TRIANGLE, [-1.0, 4.0, 2.0], [0.0, 2.0, 0.0]),
        (TRIANGLE, [0.5, -1.0, 1.0], [0.5, 0.0, 0.0]),
        (TRIANGLE, [2.0, 2.0, -1.0], [1.0, 1.0, 0.0]),
        (TRIANGLE, [-3.0, 0.5, 0.0], [0.0, 0.5, 0.0]),
        (TRIANGLE, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
        (LINE, [2.5, 1.0, 0.0], [2.5, 0.0, 0.0]),
        (np.ones((3, 3)), [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
    ],
)
def test_faces_edges_corners_and_flat_triangles(
    corners: np.ndarray, point: list[float], closest: list[float]
) -> None:
    distance = distances_from_triangles(np.array([point]), corners[None])
    assert distance == pytest.approx(np.linalg.norm(np.subtract(point, closest)), abs=1e-15)


@pytest.mark.parametrize("surface", [bumpy_sphere(), bent_capsule()])
def test_surfaces_against_all_triangles_by_trimesh(surface: Surface) -> None:
    rng = np.random.default_rng(6)
    spread = 0.4 * surface.diagonal * rng.normal(size=(200, 3))
    points = np.concatenate([surface.centroid + spread, surface.points[:50]])
    corners, count = surface.points[surface.triangles], len(surface.triangles)
    for point, distance in zip(points, distances_from_surface(surface, points), strict=True):
        feet = trimesh.triangles.closest_point(corners, np.repeat(point[None], count, axis=0))
        assert distance == pytest.approx(np.linalg.norm(feet - point, axis=1).min(), abs=1e-12)


@pytest.mark.parametrize("surface", [bumpy_sphere(), bent_capsule()])
def test_closest_points_lie_on_the_surface_and_are_as_near(surface: Surface) -> None:
    rng = np.random.default_rng(8)
    points = surface.centroid + 0.4 * surface.diagonal * rng.normal(size=(300, 3))
    points = np.concatenate([points, surface.points[:50]])
    triangles, weights = closest_points(surface, points)
    assert (weights >= 0.0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    feet = (weights[:, :, None] * surface.points[surface.triangles[triangles]]).sum(1)
    distances = np.linalg.norm(feet - points, axis=1)
    np.testing.assert_allclose(distances, distances_from_surface(surface, points), atol=1e-12)


def test_no_point_of_an_uneven_surface_is_nearer() -> None:
    """Long thin triangles beside small ones, where a triangle's middle says little."""
    surface = bumpy_sphere()
    stretched = surface.moved(surface.points * np.array([50.0, 1.0, 0.02]))
    rng = np.random.default_rng(7)
    corners = stretched.points[stretched.triangles]
    points = stretched.points.mean(axis=0) + np.ptp(stretched.points, axis=0) * rng.normal(
        size=(30, 3)
    )
    samples = rng.dirichlet(np.ones(3), size=200)
    everywhere = np.einsum("sk,tkj->stj", samples, corners).reshape(-1, 3)
    for point, distance in zip(points, distances_from_surface(stretched, points), strict=True):
        assert distance <= np.linalg.norm(everywhere - point, axis=1).min()
