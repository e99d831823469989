"""The compiled hull is the one that NumPy and Qhull find, or none."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from common.kernels import compiled_only, without_kernels
from scipy.spatial.transform import Rotation

from dicedesign.errors import DegenerateBodyError
from dicedesign.geometry.hulls.hull import ConvexHull, convex_hull
from dicedesign.kernels import ops as kernels
from dicedesign.tolerances import COPLANAR_TOLERANCE, COPLANAR_TOLERANCE_FLOAT32
from tests.reference import solids

pytestmark = compiled_only

Generator = np.random.Generator

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))
INDICES = ("source", "facet_start", "tail", "twin", "facet", "next", "previous", "head")


def turn(points: np.ndarray, rng: Generator) -> np.ndarray:
    return points @ Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()


def sphere(rng: Generator, count: int) -> np.ndarray:
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


def on_cube(rng: Generator, count: int) -> np.ndarray:
    """The corners of a cube and points in its facets."""
    points = rng.uniform(-1, 1, size=(count, 3))
    across = np.arange(3) == rng.integers(3, size=(count, 1))
    return np.concatenate([CUBE, np.where(across, np.sign(points), points)])


def lattice(rng: Generator, count: int, reach: int) -> np.ndarray:
    return np.unique(rng.integers(-reach, reach + 1, size=(count, 3)), axis=0).astype(float)


def power(rng: Generator, low: float, high: float) -> float:
    return float(10.0 ** rng.uniform(low, high))


KINDS: dict[str, Callable[[Generator, int], np.ndarray]] = {
    "sphere": sphere,
    "ball": lambda rng, n: rng.normal(size=(5 * n, 3)),
    "lattice": lambda rng, n: lattice(rng, n, 2),
    "fine lattice": lambda rng, n: lattice(rng, 3 * n, 6),
    "turned lattice": lambda rng, n: turn(lattice(rng, n, 2), rng),
    "prism": lambda rng, n: solids.prism(n, power(rng, -1, 1)).points,
    "turned prism": lambda rng, n: turn(solids.prism(n, 0.7).points, rng),
    "cone": lambda rng, n: solids.bipyramid(n, 2.0).points[:-1],
    "bipyramid": lambda rng, n: turn(solids.bipyramid(n).points, rng),
    "box": lambda rng, n: CUBE * 10.0 ** rng.uniform(-3, 0, size=3),
    "turned box": lambda rng, n: turn(CUBE * 10.0 ** rng.uniform(-3, 0, size=3), rng),
    "points on a box": on_cube,
    "points on a turned box": lambda rng, n: turn(on_cube(rng, n), rng),
    "far from the origin": lambda rng, n: sphere(rng, n) + power(rng, 1, 8),
    "tiny": lambda rng, n: sphere(rng, n) * power(rng, -200, -20),
    "huge": lambda rng, n: sphere(rng, n) * power(rng, 20, 200),
    "needle": lambda rng, n: turn(sphere(rng, n) * [1.0, 1e-4, power(rng, -6, -2)], rng),
    "plate": lambda rng, n: turn(sphere(rng, n) * [1.0, 1.0, power(rng, -7, -2)], rng),
    "single precision": lambda rng, n: sphere(rng, 8 * n).astype(np.float32),
    "single precision box": lambda rng, n: turn(on_cube(rng, n), rng).astype(np.float32),
}


def kernel_hull(points: np.ndarray) -> dict[str, object] | None:
    single = points.dtype == np.float32
    tolerance = COPLANAR_TOLERANCE_FLOAT32 if single else COPLANAR_TOLERANCE
    return kernels.convex_hull(points, tolerance, float(np.finfo(points.dtype).eps))


def numpy_hull(points: np.ndarray, tolerance: float | None = None) -> ConvexHull:
    """The hull without the kernels."""
    with without_kernels():
        hull = convex_hull(points, tolerance)
        for name in ("normals", "areas", "centroid", "unevenness", "warp", "outgoing"):
            getattr(hull, name)
        return hull


def assert_same(actual: ConvexHull, expected: ConvexHull) -> None:
    for name in INDICES:
        value = getattr(actual, name)
        assert value.dtype == np.int64, name
        np.testing.assert_array_equal(value, getattr(expected, name), err_msg=name)
    for ours, theirs in zip(actual.outgoing, expected.outgoing, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(actual.vertices, expected.vertices)
    extent = float(np.ptp(expected.vertices, axis=0).max())
    np.testing.assert_allclose(actual.normals, expected.normals, rtol=0, atol=1e-13)
    np.testing.assert_allclose(actual.areas, expected.areas, rtol=1e-10)
    reach = extent + float(np.abs(expected.vertices).max())
    np.testing.assert_allclose(actual.centroid, expected.centroid, rtol=0, atol=1e-14 * reach)
    assert actual.unevenness == pytest.approx(expected.unevenness, abs=1e-15 * reach)
    assert actual.warp == pytest.approx(expected.warp, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_the_hull_of_numpy_and_qhull(kind: str) -> None:
    answered = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        points = KINDS[kind](rng, int(rng.integers(6, 50)))
        answered += kernel_hull(points) is not None
        ours, theirs = convex_hull(points), numpy_hull(points)
        assert_same(ours, theirs)
        assert_same(convex_hull(points, 0.0), numpy_hull(points, 0.0))
        if theirs.finer is not None:
            assert ours.finer is not None
            assert_same(ours.finer.hull, theirs.finer.hull)
            np.testing.assert_array_equal(ours.finer.facet, theirs.finer.facet)
    assert answered == 12


def polygons(hull: ConvexHull) -> list[list[int]]:
    corners = np.split(hull.source[hull.tail], hull.facet_start[1:-1])
    return [facet.tolist() for facet in corners]


@pytest.mark.parametrize("reach", [1, 2, 3, 10])
def test_it_is_the_exact_hull_of_lattice_points(reach: int) -> None:
    for seed in range(25):
        rng = np.random.default_rng(seed)
        points = lattice(rng, int(rng.integers(8, 80)), reach)
        points = points[rng.permutation(len(points))]
        try:
            exact = numpy_hull(points, 0.0)
        except DegenerateBodyError:
            assert kernel_hull(points) is None
            continue
        assert kernel_hull(points) is not None
        assert polygons(convex_hull(points)) == polygons(exact)


def test_the_first_of_repeated_points_stands_for_all() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        points = np.repeat(sphere(rng, 15), 3, axis=0)[rng.permutation(45)]
        hull = convex_hull(points)
        assert kernel_hull(points) is not None
        first = np.sort(np.unique(points, axis=0, return_index=True)[1])
        np.testing.assert_array_equal(hull.source, first)
        np.testing.assert_array_equal(hull.tail, convex_hull(points[first]).tail)
