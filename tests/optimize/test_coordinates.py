"""Facet, vertex and symmetric coordinates: shapes are reproduced, and facets stay flat and
symmetric, whatever the others do."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import HalfspaceIntersection
from scipy.spatial.distance import cdist

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.point_groups import point_group
from dicedesign.geometry.sphere import unit_vectors
from dicedesign.optimize.coordinates import (
    FacetCoordinates,
    SymmetricCoordinates,
    VertexCoordinates,
    orbits_of_directions,
)
from dicedesign.optimize.starts.shapes import (
    HENDECAHEDRA,
    hendecahedron,
    mesh_start,
    prism,
    repulsion,
)
from dicedesign.rest.poses import rest_poses

STARTS = {
    "prism": prism(12),
    "flat prism": prism(5, cap=0.0),
    "repulsion": repulsion(11, 0),
    **{kind: hendecahedron(kind) for kind in HENDECAHEDRA},
}


def corners(points: np.ndarray) -> np.ndarray:
    """Corners, rounded and sorted, so that equal shapes have equal arrays."""
    vertices = np.round(convex_hull(points).vertices, 9) + 0.0
    return vertices[np.lexsort(vertices.T)]


@pytest.mark.parametrize("kind", [FacetCoordinates, VertexCoordinates])
def test_coordinates_reproduce_their_shape(kind) -> None:
    for name, start in STARTS.items():
        hull = convex_hull(start.points)
        origin = 0.9 * hull.centroid + 0.1 * hull.vertices[0]
        coordinates, parameters = kind.of(start.points, origin)
        again = coordinates.shape(parameters).points
        np.testing.assert_allclose(corners(again), corners(start.points), atol=1e-9, err_msg=name)
        rebuilt = convex_hull(again)
        assert len(rebuilt.normals) == len(hull.normals)
        np.testing.assert_allclose(rebuilt.centroid, hull.centroid, atol=1e-13)


def test_facets_stay_flat_under_any_change() -> None:
    """There are as many facets as half-spaces that cut, by the intersection of Qhull."""
    for (name, start), noise in product(STARTS.items(), (1e-6, 1e-3, 0.05)):
        coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
        count = len(parameters) // 4
        moved = parameters + noise * np.random.default_rng(0).normal(size=parameters.shape)
        normals = unit_vectors(moved[: 3 * count].reshape(count, 3))
        half_spaces = np.hstack([normals, -np.exp(moved[3 * count :])[:, None]])
        cutting = len(np.unique(HalfspaceIntersection(half_spaces, np.zeros(3)).dual_vertices))
        hull = convex_hull(coordinates.shape(moved).points)
        assert len(hull.normals) == cutting, name
        nearest = (hull.normals @ normals.T).max(axis=1)
        np.testing.assert_allclose(nearest, 1.0, atol=1e-9)


def symmetric_points(name: str, seed: int = 0) -> np.ndarray:
    """A random polyhedron with facets anywhere, in the plane y = 0 and along z, on both sides."""
    rng = np.random.default_rng(seed)
    first = rng.normal(size=(3, 3))
    first[1, 1] = 0.0
    first[2, :2] = 0.0
    first = np.concatenate([first, -first]) / np.tile(np.linalg.norm(first, axis=1), 2)[:, None]
    group = point_group(name)
    normals = (group[:, None] @ first[None, :, :, None])[..., 0]
    distances = np.broadcast_to(rng.uniform(1.0, 1.1, size=6), (len(group), 6))
    normals, where = np.unique(normals.reshape(-1, 3).round(12), axis=0, return_index=True)
    # Opposite facets may be images of each other; the first distance then counts for both.
    orbits = orbits_of_directions(normals, group)
    first_of_orbit = np.unique(orbits, return_index=True)[1]
    return polyhedron_corners(normals, distances.ravel()[where][first_of_orbit][orbits])


def asymmetry(points: np.ndarray, group: np.ndarray) -> float:
    """Largest distance of an image of a corner of the hull from the nearest corner."""
    corners = points[QhullHull(points).vertices]
    images = (corners @ group.transpose(0, 2, 1)).reshape(-1, 3)
    return float(cdist(images, corners).min(axis=1).max())


@pytest.mark.parametrize("name", ["C1", "Cs", "Ci", "C5", "S4", "D2d", "T", "Oh"])
def test_symmetric_parameters(name: str) -> None:
    """Any make a symmetric shape, and they are the components along orthonormal directions: the
    shortest step of the parameters is the shortest symmetric step of the half-spaces."""
    group, hull = point_group(name), convex_hull(symmetric_points(name))
    coordinates, parameters = SymmetricCoordinates.of(hull.vertices, hull.centroid, group)
    noise = np.random.default_rng(0).normal(size=len(parameters))
    moved = coordinates.shape(parameters + 0.05 * noise).points
    assert asymmetry(moved, group) < 1e-12
    assert abs(QhullHull(moved).volume / QhullHull(hull.vertices).volume - 1.0) > 1e-4

    size = coordinates.expansion.shape[1]
    square = coordinates.expansion.T @ coordinates.expansion
    np.testing.assert_allclose(square, np.eye(size), atol=1e-14)
    _, every = FacetCoordinates.of(hull.vertices, coordinates.facets.origin)
    np.testing.assert_allclose(coordinates.expansion @ parameters, every, atol=1e-8)
    # No symmetric change of the half-spaces is missing: their number is a mean of traces.
    images = np.argmax(hull.normals @ group.transpose(0, 2, 1) @ hull.normals.T, axis=-1)
    stabilizers = (images == np.arange(len(hull.normals))).sum(axis=1)
    free = (stabilizers * (np.trace(group, axis1=1, axis2=2) + 1.0)).mean()
    assert size == pytest.approx(free)


def test_a_shape_in_single_precision_becomes_exactly_symmetric() -> None:
    group = point_group("D5d")
    rounded = symmetric_points("D5d").astype(np.float32).astype(np.float64)
    # Its facets are flat to seven digits, as those of a mesh file.
    rests = len(rest_poses(symmetric_points("D5d")).normals)
    start = mesh_start(make_body(rounded.astype(np.float32)), rests)
    points = start.origin + start.scale * start.points
    coordinates, parameters = SymmetricCoordinates.of(points, np.zeros(3), group)
    assert asymmetry(points, group) > 1e-9
    assert asymmetry(coordinates.shape(parameters).points, group) < 1e-12


def test_an_orbit_broken_by_rounding_is_refused_in_words() -> None:
    angle = np.arange(12) * np.pi / 6.0
    sides = np.stack([np.cos(angle), np.sin(angle), np.full(12, -0.3)], axis=1)
    normals = np.concatenate([[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], sides])
    points = polyhedron_corners(normals, np.ones(14))
    coordinates, parameters = SymmetricCoordinates.of(points, np.zeros(3), point_group("C12v"))
    flat = coordinates.expansion @ parameters
    walls = np.bincount(coordinates.orbits)[coordinates.orbits] == 12
    flat[:42].reshape(14, 3)[walls] *= [1e-11, 1e-11, 1.0]
    text = "symmetry: expected all facets of an orbit or none to bound the solid"
    with pytest.raises(DegenerateBodyError, match=text):
        coordinates.shape(coordinates.expansion.T @ flat)


def test_orbits_of_directions() -> None:
    faces = np.array([(0, 0, 1), (1, 0, 0), (0, -1, 0), (0, 0, -1), (-1, 0, 0), (0, 1, 0)]) * 2.0
    assert orbits_of_directions(faces, point_group("Oh")).tolist() == [0] * 6
    assert orbits_of_directions(faces, point_group("D4h")).tolist() == [0, 1, 1, 0, 1, 1]
    assert orbits_of_directions(faces, point_group("C2v")).tolist() == [0, 1, 2, 3, 1, 2]
    assert orbits_of_directions(faces, point_group("Cs")).tolist() == [0, 1, 2, 0, 3, 4]
