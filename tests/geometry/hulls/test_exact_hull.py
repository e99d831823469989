"""The hull at tolerance 0 against rational arithmetic over all triples of points."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import convex_hull

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
SCALE = st.sampled_from([1.0, 1e-200, 1e200, 1 / 3])


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


@pytest.mark.parametrize("bend", [1e-13, 1e-15, 2.0**-53])
def test_a_bend_in_the_last_digit_is_detected(bend: float) -> None:
    ridge = np.concatenate([CUBE, [[0.0, -1.0, 1.0], [0.0, 1.0, 1.0]]])
    ridge[:8, 2] -= np.where(ridge[:8, 2] > 0.0, bend, 0.0)
    for scale in (1.0, 1e-200, 1e200, 3.0):
        assert len(convex_hull(ridge * scale, 0.0).facet_start) - 1 == 7
    assert len(convex_hull(ridge).facet_start) - 1 == 6
