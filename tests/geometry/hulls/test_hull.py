"""Hulls with polygonal facets, corners of half-spaces, and circles and boxes in polygons."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial import HalfspaceIntersection
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import (
    ConvexHull,
    convex_hull,
    deepest_point,
    polyhedron_corners,
)
from dicedesign.geometry.hulls.polygons import inscribed_box, inscribed_circle
from tests.reference import solids

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def turn(points: np.ndarray, seed: int) -> np.ndarray:
    return points @ Rotation.random(random_state=seed).as_matrix().T


def sizes(hull: ConvexHull) -> list[int]:
    return sorted(np.diff(hull.facet_start).tolist())


def assert_sound(hull: ConvexHull, points: np.ndarray) -> None:
    """Half-edge invariants, orientation, and all points on the inner side of every facet."""
    half_edges = np.arange(len(hull.tail))
    np.testing.assert_array_equal(hull.twin[hull.twin], half_edges)
    assert (hull.twin != half_edges).all()
    np.testing.assert_array_equal(hull.next[hull.previous], half_edges)
    np.testing.assert_array_equal(hull.facet[hull.next], hull.facet)
    assert (hull.facet[hull.twin] != hull.facet).all()
    np.testing.assert_array_equal(hull.tail[hull.twin], hull.head)
    np.testing.assert_array_equal(hull.tail[hull.next], hull.head)
    start, order = hull.outgoing
    np.testing.assert_array_equal(
        hull.tail[order], np.repeat(np.arange(len(hull.vertices)), np.diff(start))
    )
    assert len(hull.vertices) - len(hull.tail) // 2 + len(hull.normals) == 2
    np.testing.assert_array_equal(hull.vertices, points[hull.source])
    scale = np.ptp(points, axis=0).max()
    first = hull.vertices[hull.tail[hull.facet_start[:-1]]]
    heights = points @ hull.normals.T - (first * hull.normals).sum(-1)
    assert heights.max() < 1e-10 * scale
    edges = hull.vertices[hull.head] - hull.vertices[hull.tail]
    turns = np.cross(edges, edges[hull.next])
    assert ((turns * hull.normals[hull.facet]).sum(-1) > 0).all()
    middle = hull.vertices.mean(axis=0)
    assert (((first - middle) * hull.normals).sum(-1) > 0).all()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [4, 12, 200])
def test_random_hulls_agree_with_scipy_and_trimesh(seed: int, count: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 2.0, 0.3]
    hull = convex_hull(points)
    qhull = QhullHull(points)
    assert_sound(hull, points)
    np.testing.assert_array_equal(np.sort(hull.source), np.sort(qhull.vertices))
    assert hull.surface.volume == pytest.approx(qhull.volume, rel=1e-12)
    assert hull.areas.sum() == pytest.approx(qhull.area, rel=1e-12)
    mesh = trimesh.Trimesh(hull.vertices, hull.triangles, process=False)
    assert mesh.is_watertight
    np.testing.assert_allclose(hull.centroid, mesh.center_mass, rtol=0, atol=1e-12)
    assert hull.diameter == pytest.approx(
        max(np.linalg.norm(p - q) for p in hull.vertices for q in hull.vertices)
    )


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        (CUBE, [4] * 6),
        (solids.platonic("dodecahedron").points, [5] * 12),
        *[(solids.prism(n).points, sorted([n, n] + [4] * n)) for n in range(3, 21)],
    ],
)
def test_solids_have_flat_facets(points: np.ndarray, expected: list[int]) -> None:
    for seed in range(3):
        moved = turn(points, seed) + np.array([1.0, 2.0, 3.0])
        hull, qhull = convex_hull(moved), QhullHull(moved)
        assert sizes(hull) == expected
        assert_sound(hull, moved)
        assert hull.areas.sum() == pytest.approx(qhull.area, rel=1e-12)
        assert hull.surface.volume == pytest.approx(qhull.volume, rel=1e-12)


def test_clusters_on_which_qhull_gives_up_are_still_hulls() -> None:
    """Points at all scales along edges: scipy raises QhullError on some of these."""
    rng = np.random.default_rng(0)
    for seed in range(60):
        t = 10.0 ** rng.uniform(-16, 0, size=(300, 1))
        ends = CUBE[rng.integers(8, size=300)]
        others = ends * np.where(np.arange(3) == rng.integers(3, size=(300, 1)), -1.0, 1.0)
        points = np.concatenate([CUBE, (1 - t) * ends + t * others])
        points = turn(points + 1e-14 * rng.normal(size=points.shape), seed)
        assert len(convex_hull(points).normals) == 6


def test_the_tolerance_distinguishes_a_bend_from_rounding() -> None:
    for lift, facets in ((1e-4, 9), (1e-9, 9), (1e-13, 6), (0.0, 6)):
        points = CUBE.copy()
        points[7] *= 1.0 + lift
        assert len(convex_hull(points).normals) == facets
    points[7] *= 1.0 + 1e-7
    assert len(convex_hull(points).normals) == 9
    assert len(convex_hull(points.astype(np.float32)).normals) == 6
    assert len(convex_hull(points, coplanar_tolerance=1e-6).normals) == 6


@pytest.mark.parametrize("tolerance", [None, 0.0])
@pytest.mark.parametrize("exponent", [-1000, -600, -280, 280, 600, 1020])
def test_a_hull_has_normals_where_products_of_its_coordinates_are_no_floats(
    exponent: int, tolerance: float | None
) -> None:
    points = np.random.default_rng(4).normal(size=(12, 3)) * [1.0, 3.0, 0.2]
    hull, plain = convex_hull(points * 2.0**exponent, tolerance), convex_hull(points, tolerance)
    np.testing.assert_array_equal(hull.tail, plain.tail)
    np.testing.assert_array_equal(hull.normals, plain.normals)
    np.testing.assert_array_equal(hull.source, plain.source)
    np.testing.assert_array_equal(np.ldexp(hull.centroid, -exponent), plain.centroid)
    assert math.ldexp(hull.diameter, -exponent) == plain.diameter
    if abs(exponent) < 500:
        np.testing.assert_array_equal(np.ldexp(hull.areas, -2 * exponent), plain.areas)
    else:
        assert set(hull.areas) == {0.0 if exponent < 0 else np.inf}
    assert hull.warp == 0.0


def test_far_away_a_cube_is_still_a_cube() -> None:
    for seed in range(10):
        points = turn(CUBE, seed) + np.array([1e7, -2e7, 3e7])
        hull = convex_hull(points)
        assert sizes(hull) == [4] * 6
        np.testing.assert_allclose(hull.centroid, [1e7, -2e7, 3e7], rtol=1e-15)


def test_slivers_have_normals() -> None:
    """Points that are off the middle of an edge by their last bit: the area is 0 in floats."""
    ends = np.array([[1.1, 1.3, 1.7], [0.3, -0.4, 0.9]])
    middle = ends.mean(axis=0)
    rest = np.array([[0.2, 2.0, -1.0], [3.0, -0.3, -0.5], [-1.0, 0.3, 0.0]])
    slivers = 0
    for seed in range(30):
        bits = np.random.default_rng(seed).integers(-2, 3, size=(3, 3))
        points = np.concatenate([ends, middle + np.spacing(middle) * bits, rest])
        hull = convex_hull(points, 0.0)
        slivers += int((hull.areas < 1e-15).sum())
        np.testing.assert_allclose((hull.normals**2).sum(-1), 1.0, rtol=1e-14)
        first = hull.vertices[hull.tail[hull.facet_start[:-1]]]
        heights = points @ hull.normals.T - (first * hull.normals).sum(-1)
        assert heights.max() < 2e-15
    assert slivers > 10


AXES = np.concatenate([np.eye(3), -np.eye(3)])


def test_a_box_has_eight_corners() -> None:
    corners = polyhedron_corners(AXES, [1, 2, 3, 4, 5, 6])
    expected = sorted(product((-4, 1), (-5, 2), (-6, 3)))
    np.testing.assert_allclose(sorted(corners.round(12).tolist()), expected, atol=1e-13)


@pytest.mark.parametrize("seed", range(10))
def test_random_corners_satisfy_their_planes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normals = np.concatenate([AXES, rng.normal(size=(20, 3))])
    offsets = rng.uniform(0.5, 2.0, size=len(normals))
    corners = polyhedron_corners(normals, offsets)
    excess = corners @ normals.T - offsets
    assert excess.max() < 1e-13
    assert (np.sum(np.abs(excess) < 1e-12, axis=1) == 3).all()
    other = HalfspaceIntersection(np.column_stack([normals, -offsets]), np.zeros(3)).intersections
    volumes = [convex_hull(each).surface.volume for each in (corners, other)]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-13)
    assert len(corners) == len(convex_hull(other).vertices)


def test_the_deepest_point_of_a_box_and_of_none() -> None:
    normals = np.concatenate([-np.eye(3), np.eye(3)])
    point, depth = deepest_point(normals, np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]))
    assert depth == pytest.approx(0.5)
    assert (normals @ point + 0.5 <= np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0]) + 1e-12).all()
    # One below 0 and above 1 at once.
    assert deepest_point(normals, np.array([-2.0, 0.0, 0.0, 1.0, 2.0, 3.0]))[1] <= 0.0
    assert deepest_point(normals[:3], np.zeros(3) + 1.0)[1] == np.inf


@pytest.mark.parametrize("corners", [3, -4, 5, -6, 11])
def test_inscribed_circle_of_regular_polygons(corners):
    """Counterclockwise and clockwise ones."""
    shift = np.array([40.0, -7.0])
    angles = 2.0 * np.pi * np.arange(abs(corners)) / corners
    polygon = 5.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    center, radius = inscribed_circle(polygon + shift)
    assert radius == pytest.approx(5.0 * math.cos(math.pi / corners), rel=1e-9)
    np.testing.assert_allclose(center, shift, atol=1e-8)


@pytest.mark.parametrize("width", [1e-3, 3.0, 1e4])
def test_inscribed_circle_of_a_rectangle_is_in_its_middle(width):
    rectangle = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (0.0, 2.0)]) * width
    center, radius = inscribed_circle(rectangle)
    assert radius == pytest.approx(width)
    np.testing.assert_allclose(center, (5.0 * width, width), rtol=1e-7)


def largest_factor_by_search(polygon: np.ndarray, size: tuple[float, float]) -> float:
    """Largest factor over a fine grid of middles, by the distances of a box's corners from the
    edges."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    outward = np.column_stack([edges[:, 1], -edges[:, 0]])
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    reach = (outward @ (0.5 * signs * size).T).max(axis=1)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    best, middle = 0.0, 0.5 * (low + high)
    for _ in range(6):
        x, y = (np.linspace(low[k], high[k], 41) for k in range(2))
        grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        factors = (np.einsum("ij,ij->i", outward, polygon) - grid @ outward.T) / reach
        best = max(best, float(factors.min(axis=1).max()))
        middle = grid[factors.min(axis=1).argmax()]
        low, high = middle - 0.1 * (high - low), middle + 0.1 * (high - low)
    return best


@pytest.mark.parametrize("seed", range(12))
def test_inscribed_box_is_the_largest_by_search(seed):
    rng = np.random.default_rng(seed)
    count = 40 if seed == 11 else int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    if np.diff(angles, append=angles[0] + 2.0 * np.pi).max() > 0.9 * np.pi:
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False) + angles[0]
    polygon = np.column_stack([3.0 * np.cos(angles), 2.0 * np.sin(angles)]) + rng.normal(size=2)
    size = (float(rng.uniform(0.3, 3.0)), 1.0)
    center, factor = inscribed_box(polygon, size)
    assert factor == pytest.approx(largest_factor_by_search(polygon, size), rel=1e-3)
    # Its corners are inside, and one of them on an edge.
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    corners = center + 0.5 * factor * signs * size
    edges = np.roll(polygon, -1, axis=0) - polygon
    inward = np.column_stack([-edges[:, 1], edges[:, 0]])
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    distances = np.einsum("pfk,fk->pf", corners[:, None] - polygon, inward)
    assert distances.min() == pytest.approx(0.0, abs=1e-8)
    # A margin is the distance from the edges that are left, a rim that of the box of factor 1.
    center, smaller = inscribed_box(polygon, size, margin=0.2)
    corners = center + 0.5 * smaller * signs * size
    distances = np.einsum("pfk,fk->pf", corners[:, None] - polygon, inward)
    assert distances.min() == pytest.approx(0.2, abs=1e-8)
    assert inscribed_box(polygon, size, rim=0.2 / smaller)[1] == pytest.approx(smaller, rel=1e-6)
