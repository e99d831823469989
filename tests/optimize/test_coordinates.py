"""Facet, vertex, pinned and symmetric coordinates: shapes are reproduced, and facets stay flat,
where they are pinned, and symmetric, whatever the others do."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import HalfspaceIntersection

from dicedesign.errors import DegenerateBodyError, InputError
from dicedesign.geometry.hulls.hull import convex_hull, polyhedron_corners
from dicedesign.geometry.meshes.body import make_body
from dicedesign.geometry.point_groups import point_group
from dicedesign.gradient.rest_probabilities import evaluate_rests
from dicedesign.optimize.coordinates import (
    FacetCoordinates,
    SymmetricCoordinates,
    VertexCoordinates,
    orbits_of_directions,
    pin_coordinates,
)
from dicedesign.optimize.options import ExactOptions
from dicedesign.optimize.preferences import Preferences
from dicedesign.optimize.solvers.exact import solve_exact
from dicedesign.optimize.starts.search import shapes_like
from dicedesign.optimize.starts.shapes import (
    HENDECAHEDRA,
    hendecahedron,
    mesh_start,
    prism,
    repulsion,
)
from dicedesign.optimize.starts.start import Start
from dicedesign.rest.poses import rest_poses
from dicedesign.results.parts import Status

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


@pytest.fixture(params=sorted(STARTS))
def start(request) -> Start:
    return STARTS[request.param]


@pytest.mark.parametrize("kind", [FacetCoordinates, VertexCoordinates])
def test_coordinates_reproduce_their_shape(start: Start, kind) -> None:
    hull = convex_hull(start.points)
    origin = 0.9 * hull.centroid + 0.1 * hull.vertices[0]
    coordinates, parameters = kind.of(start.points, origin)
    again = coordinates.shape(parameters).points
    np.testing.assert_allclose(corners(again), corners(start.points), atol=1e-9)
    rebuilt = convex_hull(again)
    assert len(rebuilt.normals) == len(hull.normals)
    np.testing.assert_allclose(rebuilt.centroid, hull.centroid, atol=1e-13)


@pytest.mark.parametrize("noise", [1e-6, 1e-3, 0.05])
def test_facets_stay_flat_under_any_change(start: Start, noise: float) -> None:
    """There are as many facets as half-spaces that cut, by the intersection of Qhull."""
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    count = len(parameters) // 4
    moved = parameters + noise * np.random.default_rng(0).normal(size=parameters.shape)
    normals = moved[: 3 * count].reshape(count, 3)
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    half_spaces = np.hstack([normals, -np.exp(moved[3 * count :])[:, None]])
    cutting = len(np.unique(HalfspaceIntersection(half_spaces, np.zeros(3)).dual_vertices))
    hull = convex_hull(coordinates.shape(moved).points)
    assert len(hull.normals) == cutting
    nearest = (hull.normals @ normals.T).max(axis=1)
    np.testing.assert_allclose(nearest, 1.0, atol=1e-9)


def test_pruning_drops_points_inside_and_keeps_half_spaces(random_points) -> None:
    points = random_points(5, 10)
    coordinates, parameters = VertexCoordinates.of(points, points.mean(axis=0))
    inner = np.concatenate([[0.0, 0.0, 0.0], parameters, 0.5 * parameters[:3]])
    rests = evaluate_rests(torch.tensor(coordinates.shape(inner).points))
    np.testing.assert_array_equal(coordinates.prune(inner, rests), parameters)
    facets, values = FacetCoordinates.of(points, points.mean(axis=0))
    far = len(values) // 4
    idle = np.concatenate([values[: 3 * far], [1.0, 0.0, 0.0], values[3 * far :], [3.0]])
    rests = evaluate_rests(torch.tensor(facets.shape(idle).points))
    assert len(rests.hull.normals) == far
    np.testing.assert_array_equal(facets.prune(idle, rests), idle)


def test_an_origin_outside_is_refused_in_words() -> None:
    points = STARTS["repulsion"].points
    text = "facet coordinates: expected an origin inside the shape, got [3.0, 0.0, 0.0]"
    with pytest.raises(DegenerateBodyError, match=re.escape(text)):
        FacetCoordinates.of(points, np.array([3.0, 0.0, 0.0]))
    corner = convex_hull(points).vertices[0]
    with pytest.raises(DegenerateBodyError, match="expected an origin inside the shape"):
        FacetCoordinates.of(points, corner * (1.0 + 1e-9))


def test_half_spaces_that_bound_no_solid_are_refused_in_words() -> None:
    normals = np.array([(0.0, 0, 1), (0, 1, 0), (1, 0, 0), (0.1, 0.1, 0.9), (0.5, 0.2, 0.3)])
    parameters = np.concatenate([normals.ravel(), np.zeros(5)])
    text = "facet coordinates: expected half-spaces that bound a solid, got normals that leave"
    with pytest.raises(DegenerateBodyError, match=text):
        FacetCoordinates(np.zeros(3)).shape(parameters)


START = repulsion(7, 0)
PINNED = (1, 4)


def reach(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Extent (p,) of a body from the origin in each direction."""
    return (points @ directions.T).max(axis=0)


def test_free_facets_move_as_without_pins() -> None:
    rng = np.random.default_rng(0)
    origin = convex_hull(START.points).centroid
    pinned = START.directions[list(PINNED)]
    coordinates, parameters = pin_coordinates(START.points, origin, pinned)
    bare, whole = FacetCoordinates.of(START.points, origin)
    assert len(parameters) == len(whole) - 4 * len(PINNED)
    moved = parameters + 0.1 * rng.normal(size=parameters.shape)
    points = coordinates.shape(moved).points
    np.testing.assert_allclose(reach(points, pinned), reach(START.points, pinned), atol=1e-12)

    all_moved = whole.copy()
    all_moved[np.isin(whole, parameters)] = moved
    shape = bare.shape(all_moved)
    np.testing.assert_array_equal(points, shape.points)
    rows = rng.normal(size=(3, *points.shape))
    np.testing.assert_array_equal(
        coordinates.shape(moved).pull_back(rows),
        shape.pull_back(rows)[:, np.isin(whole, parameters)],
    )


@pytest.mark.parametrize("pinned", [(), (1, 4, 6)])
def test_a_design_leaves_pinned_facets_where_they_are(pinned: tuple[int, ...]) -> None:
    target = np.array([0.2, 0.1, 0.15, 0.15, 0.1, 0.1, 0.2])
    start = replace(START, pinned=pinned)
    result = solve_exact(
        shapes_like(start, 0), target, ExactOptions(prefer=Preferences(roundness=1.0))
    )
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(
        np.sort(rest_poses(result.hull.vertices).probabilities), np.sort(target), atol=1e-12
    )
    before, moved = START.directions, np.abs(result.directions - START.directions).max(axis=1)
    is_pinned = np.isin(np.arange(7), pinned)
    assert (moved[is_pinned] < 1e-12).all()
    assert (moved[~is_pinned] > 1e-4).all()
    planes = reach(result.hull.vertices, before) - reach(START.points, before)
    assert (np.abs(planes[is_pinned]) < 1e-12).all()


def test_variations_leave_pinned_facets_where_they_are() -> None:
    start = replace(START, pinned=PINNED)
    pinned = START.directions[list(PINNED)]
    for shape in islice(shapes_like(start, 0), 1, 6):
        assert shape.pinned == PINNED
        np.testing.assert_allclose(shape.directions[list(PINNED)], pinned, atol=1e-12)
        np.testing.assert_allclose(
            reach(shape.points, pinned), reach(START.points, pinned), atol=1e-12
        )
        assert np.abs(shape.directions - START.directions).max() > 1e-3


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
    corners = points[QhullHull(points).vertices]
    images = corners @ group.transpose(0, 2, 1)
    gaps = np.linalg.norm(images[:, :, None] - corners[None, None], axis=-1)
    return float(gaps.min(axis=-1).max())


@pytest.mark.parametrize("name", GROUPS)
def test_any_parameters_make_a_symmetric_shape(name: str) -> None:
    group = point_group(name)
    coordinates, parameters = symmetric(name)
    noise = np.random.default_rng(0).normal(size=len(parameters))
    moved = coordinates.shape(parameters + 0.05 * noise).points
    assert asymmetry(moved, group) < 1e-12
    before = QhullHull(symmetric_points(name)).volume
    assert abs(QhullHull(moved).volume / before - 1.0) > 1e-4


@pytest.mark.parametrize("name", GROUPS)
def test_parameters_are_the_components_along_orthonormal_directions(name: str) -> None:
    """So the shortest step of the parameters is the shortest symmetric step of the half-spaces."""
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
    with pytest.raises(InputError, match="expected directions that the point group maps onto each"):
        orbits_of_directions(faces[:5], point_group("D4h"))
    with pytest.raises(InputError, match="remove facets that nearly coincide"):
        orbits_of_directions(np.concatenate([faces, faces[:1] + 1e-7]), point_group("C4"))
