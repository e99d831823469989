"""The hull at tolerance 0 against rational arithmetic over all triples of points."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls import numpy_hull
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.geometry.hulls.qhull import hull_triangles
from dicedesign.geometry.predicates import Orientation

Corner = tuple[int, ...]
Facets = set[frozenset[Corner]]

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def corners_of(points: np.ndarray) -> list[Corner]:
    """Points times one power of two, which makes integers of their coordinates."""
    exact = [[Fraction(float(x)) for x in point] for point in points]
    scale = max(x.denominator for point in exact for x in point)
    return [tuple(int(x * scale) for x in point) for point in exact]


def height(plane: tuple[Corner, Corner, Corner], point: Corner) -> int:
    (ax, ay, az), b, c = plane
    ux, uy, uz = b[0] - ax, b[1] - ay, b[2] - az
    vx, vy, vz = c[0] - ax, c[1] - ay, c[2] - az
    wx, wy, wz = point[0] - ax, point[1] - ay, point[2] - az
    return wx * (uy * vz - uz * vy) + wy * (uz * vx - ux * vz) + wz * (ux * vy - uy * vx)


def rational_hull(points: list[Corner]) -> Facets | None:
    """Corners of all facets, or None for points on one plane."""
    corners = sorted(set(points))
    on_plane: Facets = set()
    for plane in combinations(corners, 3):
        heights = {point: height(plane, point) for point in corners}
        if (max(heights.values()) > 0) != (min(heights.values()) < 0):
            on_plane.add(frozenset(point for point, h in heights.items() if h == 0))
    if not on_plane:
        return None
    meeting = {point: sum(point in facet for facet in on_plane) for point in corners}
    return {frozenset(p for p in facet if meeting[p] >= 3) for facet in on_plane}


def assert_exact(points: np.ndarray) -> None:
    known = corners_of(points)
    expected = rational_hull(known)
    if expected is None:
        with pytest.raises(DegenerateBodyError, match=r"points on one |got one repeated"):
            convex_hull(points, 0.0)
        return
    hull = convex_hull(points, 0.0)
    inner = [known[i] for i in hull.source]
    polygons = np.split(hull.tail, hull.facet_start[1:-1])
    assert {frozenset(inner[p] for p in polygon) for polygon in polygons} == expected
    assert len(polygons) == len(expected)
    assert len(hull.vertices) - len(hull.tail) // 2 + len(polygons) == 2
    np.testing.assert_array_equal(hull.vertices, points[hull.source])
    np.testing.assert_array_equal(hull.tail[hull.twin], hull.head)
    # At each of its corners a facet turns left, seen from outside.
    for p, q, r in zip(hull.tail[hull.previous], hull.tail, hull.head, strict=True):
        heights = [height((inner[p], inner[q], inner[r]), point) for point in inner]
        assert min(heights) < 0
        assert max(heights) == 0


LATTICE = st.lists(st.tuples(*[st.integers(-2, 2)] * 3), min_size=4, max_size=10)
FAR = st.sampled_from([0.0, 1.0, 1e7, -3.3e9])
SCALE = st.sampled_from([1.0, 1e-200, 1e200, 1 / 3])


@settings(max_examples=150, deadline=None)
@given(LATTICE, SCALE, FAR)
def test_lattice_points(points: list[tuple[int, ...]], scale: float, far: float) -> None:
    assert_exact((np.array(points, dtype=np.float64) + far) * scale)


@settings(max_examples=250, deadline=None)
@given(LATTICE, st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 2, 50, 5000]), SCALE)
def test_lattice_points_with_noise_in_their_last_bits(
    points: list[tuple[int, ...]], seed: int, bits: int, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    moved = (np.array(points) + rng.integers(0, 2, size=3)) * scale
    ulp = np.spacing(np.abs(moved).max())
    assert_exact(moved + ulp * rng.integers(-bits, bits + 1, size=moved.shape))


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(-2, 2)] * 3), min_size=4, max_size=9),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1e-8, 1e-15, 1e-16, 1e-17, 1e-30]),
)
def test_plates_and_needles(points: list[tuple[int, ...]], seed: int, thin: float) -> None:
    rng = np.random.default_rng(seed)
    squeezed = np.array(points) * rng.permutation([1.0, 1.0, thin])
    sheared = squeezed + np.outer(squeezed[:, 0], rng.integers(-1, 2, size=3))
    assert_exact(sheared)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [4, 12, 300])
def test_in_general_position_a_tolerance_makes_no_difference(seed: int, count: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 2.0, 0.3] + [1, 0, 5]
    exact, other = convex_hull(points, 0.0), convex_hull(points)
    for name in ("source", "facet_start", "tail", "twin"):
        np.testing.assert_array_equal(getattr(exact, name), getattr(other, name))


def on_cube(seed: int, count: int, noise: float) -> np.ndarray:
    """The corners of a cube, and points on its facets and edges, off by noise."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, size=(count, 3))
    for _ in range(2):
        points[np.arange(count), rng.integers(3, size=count)] = rng.choice([-1.0, 1.0], count)
    return np.concatenate([CUBE, points + noise * rng.normal(size=points.shape)])


def test_points_on_facets_and_edges_are_no_corners() -> None:
    points = on_cube(0, 800, 0.0)
    hull = convex_hull(np.concatenate([points, points]), 0.0)
    assert np.diff(hull.facet_start).tolist() == [4] * 6
    assert len(hull.vertices) == 8


@pytest.mark.parametrize("noise", [1e-16, 1e-15, 1e-13])
def test_noise_on_facets_is_kept(noise: float) -> None:
    points = on_cube(1, 120, noise)
    hull = convex_hull(points, 0.0)
    known = corners_of(points)
    inner = [known[i] for i in hull.source]
    assert len(hull.facet_start) - 1 > 6
    for f in range(len(hull.facet_start) - 1):
        p, q, r = (inner[i] for i in hull.tail[hull.facet_start[f] :][:3])
        assert max(height((p, q, r), point) for point in known) == 0


@pytest.mark.parametrize("bend", [1e-13, 1e-15, 2.0**-53])
def test_a_bend_in_the_last_digit_is_seen(bend: float) -> None:
    ridge = np.concatenate([CUBE, [[0.0, -1.0, 1.0], [0.0, 1.0, 1.0]]])
    ridge[:8, 2] -= np.where(ridge[:8, 2] > 0.0, bend, 0.0)
    for scale in (1.0, 1e-200, 1e200, 3.0):
        assert len(convex_hull(ridge * scale, 0.0).facet_start) - 1 == 7
    assert len(convex_hull(ridge).facet_start) - 1 == 6


def spoiled(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles with one corner replaced by a point inside."""
    triangles, neighbors = hull_triangles(points)
    if len(points) > 20:
        inner = np.setdiff1d(np.arange(len(points)), triangles)
        triangles[triangles == triangles[0, 0]] = inner[0]
    return triangles, neighbors


def doubled(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A surface with a triangle too many."""
    triangles, neighbors = hull_triangles(points)
    return np.concatenate([triangles, triangles[:1]]), np.concatenate([neighbors, neighbors[:1]])


@pytest.mark.parametrize("proposal", [spoiled, doubled])
def test_a_wrong_proposal_is_repaired(
    monkeypatch: pytest.MonkeyPatch, proposal: Callable[..., object]
) -> None:
    points = np.random.default_rng(5).normal(size=(60, 3))
    expected = convex_hull(points)
    monkeypatch.setattr(numpy_hull, "hull_triangles", proposal)
    found = convex_hull(points, 0.0)
    np.testing.assert_array_equal(found.source, expected.source)
    np.testing.assert_array_equal(found.tail, expected.tail)


def test_a_surface_that_surrounds_its_inside_twice_is_no_hull() -> None:
    """A double pyramid over a pentagram is convex at every edge."""
    angles = 2.0 * np.pi * np.arange(5) / 5.0
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(5)])
    apexes = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
    points = np.concatenate([ring, apexes, 0.1 * CUBE[[0, 3, 5, 6]]])
    sides = Orientation(points)
    for step, once in ((1, True), (2, False)):
        corner = np.arange(5)
        following = (corner + step) % 5
        upper = np.column_stack([corner, following, np.full(5, 5)])
        lower = np.column_stack([following, corner, np.full(5, 6)])
        triangles, inside = np.concatenate([upper, lower]), np.arange(7, 11)
        assert len(numpy_hull._faulty(sides, triangles, inside)) == 0
        assert numpy_hull._covers_once(sides, points, triangles, inside) == once
