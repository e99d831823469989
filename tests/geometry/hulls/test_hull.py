"""Hulls with polygonal facets: counts, half-edges, measures, tolerances and errors."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull as QhullHull
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
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
