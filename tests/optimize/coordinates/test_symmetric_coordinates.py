"""Symmetric coordinates: one facet moves for each orbit, and the shape stays symmetric."""

from __future__ import annotations

import re

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.halfspaces import polyhedron_corners
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.point_groups import point_group
from dicedesign.optimize.coordinates.facets import FacetCoordinates
from dicedesign.optimize.coordinates.linked import SymmetricCoordinates, orbits_of_directions
from dicedesign.optimize.starts.built_in import prism
from dicedesign.optimize.starts.start import Start

CUBE = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
GROUPS = ["C1", "Cs", "Ci", "C5", "C3v", "S4", "D2d", "D5d", "T", "Oh"]


def upright(start: Start) -> np.ndarray:
    """Points of a prism, centered and with its axis along z."""
    return start.points - convex_hull(start.points).centroid


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


def symmetric(name: str, seed: int = 0) -> tuple[SymmetricCoordinates, np.ndarray]:
    points = symmetric_points(name, seed)
    return SymmetricCoordinates.of(points, convex_hull(points).centroid, point_group(name))


def asymmetry(points: np.ndarray, group: np.ndarray) -> float:
    """Largest distance of an image of a corner of the hull from the nearest corner."""
    corners = points[ConvexHull(points).vertices]
    images = corners @ group.transpose(0, 2, 1)
    gaps = np.linalg.norm(images[:, :, None] - corners[None, None], axis=-1)
    return float(gaps.min(axis=-1).max())


@pytest.mark.parametrize("name", GROUPS)
def test_any_parameters_make_a_symmetric_shape(name: str) -> None:
    group = point_group(name)
    coordinates, parameters = symmetric(name)
    for seed in range(2):
        noise = np.random.default_rng(seed).normal(size=len(parameters))
        moved = coordinates.shape(parameters + 0.05 * noise).points
        assert asymmetry(moved, group) < 1e-12
        before = ConvexHull(symmetric_points(name)).volume
        assert abs(ConvexHull(moved).volume / before - 1.0) > 1e-4


@pytest.mark.parametrize("name", GROUPS)
def test_parameters_are_the_components_along_orthonormal_directions(name: str) -> None:
    """So the shortest step of the parameters is the shortest symmetric one of all half-spaces."""
    coordinates, parameters = symmetric(name)
    size = coordinates.expansion.shape[1]
    square = coordinates.expansion.T @ coordinates.expansion
    np.testing.assert_allclose(square, np.eye(size), atol=1e-14)
    hull = convex_hull(symmetric_points(name))
    _, every = FacetCoordinates.of(hull.vertices, coordinates.facets.origin)
    np.testing.assert_allclose(coordinates.expansion @ parameters, every, atol=1e-8)
    # No symmetric change of the half-spaces is missing: their number is a mean of traces.
    group = point_group(name)
    images = np.argmax(
        (group[:, None] @ hull.normals[None, :, :, None])[..., 0] @ hull.normals.T, -1
    )
    kept = (images == np.arange(len(hull.normals))).sum(axis=1)
    free = (kept * (np.trace(group, axis1=1, axis2=2) + 1.0)).mean()
    assert size == pytest.approx(free)


@pytest.mark.parametrize("name", ["C3v", "D2d"])
def test_gradcheck_of_points(name: str) -> None:
    coordinates, parameters = symmetric(name, seed=3)
    leaf = torch.tensor(parameters, requires_grad=True)
    assert torch.autograd.gradcheck(coordinates.points, (leaf,), eps=1e-6, atol=1e-6, rtol=1e-4)


def test_the_origin_is_moved_to_where_the_group_keeps_it() -> None:
    points = CUBE + np.array([3.0, -2.0, 0.0])
    coordinates, _ = SymmetricCoordinates.of(points, np.array([3.1, -2.2, 0.4]), point_group("Cs"))
    np.testing.assert_array_equal(coordinates.facets.origin, [3.1, -2.2, 0.0])


def test_a_shape_in_single_precision_becomes_symmetric_to_the_last_digits() -> None:
    group = point_group("D5d")
    rounded = symmetric_points("D5d").astype(np.float32).astype(np.float64)
    # Its facets are flat to seven digits.
    hull = convex_hull(rounded, 1e-6)
    coordinates, parameters = SymmetricCoordinates.of(rounded, np.zeros(3), group, lambda _: hull)
    assert asymmetry(rounded, group) > 1e-9
    assert asymmetry(coordinates.shape(parameters).points, group) < 1e-12


@pytest.mark.parametrize(
    ("points", "name", "text"),
    [
        (
            CUBE,
            "C3",
            "symmetry: expected directions that the point group maps onto each other, got",
        ),
        (CUBE, "C8", "whose image under element 1 is 0.765 from the nearest unit vector; turn"),
        (upright(prism(5))[:, [2, 0, 1]], "C5", "turn the shape's main axis to z"),
        (
            CUBE + np.array([0.0, 0.0, 0.1]),
            "Oh",
            "at the same distance from [0.0, 0.0, 0.0], got a ratio of 1.22",
        ),
    ],
)
def test_shapes_without_the_symmetry_are_refused_in_words(
    points: np.ndarray, name: str, text: str
) -> None:
    with pytest.raises(InputError, match=re.escape(text)):
        SymmetricCoordinates.of(points, np.zeros(3), point_group(name))


def test_an_orbit_that_rounding_would_break_is_refused_in_words() -> None:
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
    with pytest.raises(InputError, match="expected directions that the point group maps onto each"):
        orbits_of_directions(faces[:5], point_group("D4h"))
    with pytest.raises(InputError, match="remove facets that nearly coincide"):
        orbits_of_directions(np.concatenate([faces, faces[:1] + 1e-7]), point_group("C4"))
