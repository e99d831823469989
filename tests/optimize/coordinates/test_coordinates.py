"""Facet and vertex coordinates reproduce shapes, and facets stay flat."""

from __future__ import annotations

import re

import numpy as np
import pytest
import torch
from scipy.spatial import HalfspaceIntersection

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.solid import solid_properties
from dicedesign.gradient.rest_odds import evaluate_rests
from dicedesign.optimize.coordinates.facets import FacetCoordinates, VertexCoordinates
from dicedesign.optimize.starts.built_in import HENDECAHEDRA, hendecahedron, prism
from dicedesign.optimize.starts.half_space_odds import repulsion
from dicedesign.optimize.starts.start import Start

STARTS = {
    "prism": prism(12),
    "flat prism": prism(5, cap=0.0),
    "repulsion": repulsion(11, 0),
    **{kind: hendecahedron(kind) for kind in HENDECAHEDRA},
}


def corners(points: np.ndarray) -> np.ndarray:
    """Rounded and sorted, so that equal shapes have equal arrays."""
    vertices = np.round(convex_hull(points).vertices, 9) + 0.0
    return vertices[np.lexsort(vertices.T)]


def evaluated(coordinates, parameters: np.ndarray) -> np.ndarray:
    return coordinates.shape(parameters).points


@pytest.fixture(params=sorted(STARTS))
def start(request) -> Start:
    return STARTS[request.param]


@pytest.mark.parametrize("kind", [FacetCoordinates, VertexCoordinates])
def test_coordinates_reproduce_their_shape(start: Start, kind) -> None:
    hull = convex_hull(start.points)
    origin = 0.9 * hull.centroid + 0.1 * hull.vertices[0]
    coordinates, parameters = kind.of(start.points, origin)
    again = evaluated(coordinates, parameters)
    np.testing.assert_allclose(corners(again), corners(start.points), atol=1e-9)
    made = convex_hull(again)
    assert len(made.normals) == len(hull.normals)
    np.testing.assert_allclose(made.centroid, hull.centroid, atol=1e-13)


@pytest.mark.parametrize("kind", [FacetCoordinates, VertexCoordinates])
def test_coordinates_of_any_unit_and_place(kind) -> None:
    points = 250.0 * STARTS["repulsion"].points + [1000.0, -2000.0, 500.0]
    hull = convex_hull(points)
    coordinates, parameters = kind.of(points, hull.centroid)
    made = convex_hull(evaluated(coordinates, parameters))
    assert len(made.vertices) == len(hull.vertices)
    volumes = [solid_properties(body.vertices, body.triangles)[0] for body in (made, hull)]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-9)
    np.testing.assert_allclose(made.centroid, hull.centroid, rtol=1e-9)


@pytest.mark.parametrize("kind", [FacetCoordinates, VertexCoordinates])
def test_gradcheck_of_points(random_points, kind) -> None:
    points = random_points(4, 9)
    coordinates, parameters = kind.of(points, convex_hull(points).centroid)
    rng = np.random.default_rng(0)
    parameters = parameters + 0.01 * rng.normal(size=parameters.shape)
    leaf = torch.tensor(parameters, requires_grad=True)
    assert torch.autograd.gradcheck(coordinates.points, (leaf,), eps=1e-6, atol=1e-6, rtol=1e-4)


@pytest.mark.parametrize("noise", [1e-6, 1e-3, 0.05])
def test_facets_stay_flat_under_any_change(start: Start, noise: float) -> None:
    """As many polygonal facets as half-spaces that cut, which Qhull's intersection tells."""
    coordinates, parameters = FacetCoordinates.of(start.points, np.zeros(3))
    count = len(parameters) // 4
    for seed in range(2):
        rng = np.random.default_rng(seed)
        moved = parameters + noise * rng.normal(size=parameters.shape)
        normals = moved[: 3 * count].reshape(count, 3)
        normals = normals / np.linalg.norm(normals, axis=1)[:, None]
        half_spaces = np.hstack([normals, -np.exp(moved[3 * count :])[:, None]])
        cutting = len(np.unique(HalfspaceIntersection(half_spaces, np.zeros(3)).dual_vertices))
        hull = convex_hull(evaluated(coordinates, moved))
        assert len(hull.normals) == cutting
        nearest = (hull.normals @ normals.T).max(axis=1)
        np.testing.assert_allclose(nearest, 1.0, atol=1e-9)
        if noise < 1e-2:
            assert cutting == count


def test_pruned_drops_points_inside_and_keeps_half_spaces(random_points) -> None:
    points = random_points(5, 10)
    coordinates, parameters = VertexCoordinates.of(points, points.mean(axis=0))
    inner = np.concatenate([[0.0, 0.0, 0.0], parameters, 0.5 * parameters[:3]])
    rests = evaluate_rests(torch.tensor(evaluated(coordinates, inner)))
    np.testing.assert_array_equal(coordinates.pruned(inner, rests), parameters)
    facets, values = FacetCoordinates.of(points, points.mean(axis=0))
    far = len(values) // 4
    idle = np.concatenate([values[: 3 * far], [1.0, 0.0, 0.0], values[3 * far :], [3.0]])
    rests = evaluate_rests(torch.tensor(evaluated(facets, idle)))
    assert len(rests.hull.normals) == far
    np.testing.assert_array_equal(facets.pruned(idle, rests), idle)


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
