"""Symmetric solids whose resting probabilities have a closed form.

If all corners are on a sphere around the center of mass and all facets are stable, the probability
of a facet is its share of the solid angle. If symmetry maps any facet to any other, all
probabilities are equal.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from scipy.spatial import ConvexHull as Triangulation
from scipy.spatial.transform import Rotation

from dicedesign.runtime.arrays import Floats
from tests.reference.problem import Problem

HALF_TURNS = tuple(np.diag(s) for s in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1]))

CYCLES = (np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]])


def platonic(name: str) -> Problem:
    """A Platonic solid; all facets are images of each other."""
    return _with_equal_facets(PLATONIC[name], PLATONIC_FACETS[name])


def archimedean(name: str) -> Problem:
    """An Archimedean solid: regular facets with corners on a sphere."""
    points, facets = ARCHIMEDEAN[name], ARCHIMEDEAN_FACETS[name]
    distances = np.sqrt(((points[1:] - points[0]) ** 2).sum(-1))
    edge = float(distances.min() / np.sqrt((points[0] ** 2).sum()))
    shares = [np.full(count, regular_share(k, edge)) for k, count in facets.items()]
    return _with_probabilities(points, np.concatenate(shares))


def catalan(name: str) -> Problem:
    """The dual of an Archimedean solid; all facets are images of each other."""
    points = ARCHIMEDEAN[name]
    planes = Triangulation(points).equations
    corners = -planes[:, :3] / planes[:, 3:]
    return _with_equal_facets(corners, len(points))


def prism(sides: int, height: float = 1.0) -> Problem:
    """An upright prism over a regular polygon of circumradius 1."""
    points = _stack(_ring(sides), _ring(sides), height)
    edge = 2.0 * np.sin(np.pi / sides) / np.sqrt(1.0 + height * height / 4.0)
    base = regular_share(sides, edge)
    return _with_probabilities(
        points, np.array([base, base, *[(0.5 - base) * 2.0 / sides] * sides])
    )


def antiprism(sides: int) -> Problem:
    """The antiprism with regular facets, over a polygon of circumradius 1."""
    edge = 2.0 * np.sin(np.pi / sides)
    height = np.sqrt(edge * edge - 4.0 * np.sin(np.pi / (2.0 * sides)) ** 2)
    points = _stack(_ring(sides), _ring(sides, 0.5), height)
    base = regular_share(sides, edge / np.sqrt(1.0 + height * height / 4.0))
    return _with_probabilities(
        points, np.array([base, base, *[(0.5 - base) / sides] * (2 * sides)])
    )


def bipyramid(sides: int, height: float = 1.0) -> Problem:
    """Two pyramids of a height on a regular polygon of circumradius 1."""
    return _with_equal_facets(
        np.concatenate([_ring(sides), [[0.0, 0.0, height], [0.0, 0.0, -height]]]), 2 * sides
    )


def box(a: float, b: float, c: float) -> Problem:
    """A box with edges a, b, c along the axes."""
    points = np.array(list(product([-0.5, 0.5], repeat=3))) * [a, b, c]
    shares = []
    for x, y, z in ((a, b, c), (b, c, a), (c, a, b)):
        shares += [float(np.arctan2(x * y, z * np.sqrt(x * x + y * y + z * z)) / np.pi)] * 2
    return _with_probabilities(points, np.array(shares))


def icosphere(subdivisions: int) -> Problem:
    """An icosahedron whose triangles are split into four several times, with all corners on the
    sphere. Its coordinates have the symmetry of a tetrahedron without rounding."""
    points = PLATONIC["icosahedron"] / np.sqrt((PLATONIC["icosahedron"] ** 2).sum(-1))[:, None]
    for _ in range(subdivisions):
        triangles = Triangulation(points).simplices
        edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        ends = points[np.unique(np.sort(edges, axis=1), axis=0)].transpose(1, 0, 2)
        middle = ends[0] + ends[1]
        # Summed in the order of size, so that permuted coordinates have permuted sums.
        squared = np.sort(middle * middle, axis=1).sum(-1)
        points = np.concatenate([points, middle / np.sqrt(squared)[:, None]])
    shares = np.full(20, 0.05) if subdivisions == 0 else None
    return Problem(
        points,
        np.zeros(3),
        shares=shares,
        rests=20 * 4**subdivisions,
        symmetries=(*HALF_TURNS, *CYCLES),
    )


def regular_share(corners: int, edge: float) -> float:
    """Part of the sphere that a regular polygon with corners on it covers.

    corners: number of corners; edge: length of an edge over the radius of the sphere. The polygon
    consists of right-angled triangles with legs x, y and the area 2 atan(tan(x / 2) tan(y / 2)).
    """
    y = np.arcsin(edge / 2.0)
    to_corner = np.arcsin(np.sin(y) / np.sin(np.pi / corners))
    x = np.arctan(np.tan(to_corner) * np.cos(np.pi / corners))
    return float(corners * np.arctan(np.tan(x / 2.0) * np.tan(y / 2.0)) / np.pi)


def _ring(sides: int, offset: float = 0.0) -> Floats:
    """Corners (sides, 3) of a regular polygon in the plane z = 0. offset: rotation, in sides."""
    angles = 2.0 * np.pi * (np.arange(sides) + offset) / sides
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])


def _stack(lower: Floats, upper: Floats, height: float) -> Floats:
    shift = np.array([0.0, 0.0, height / 2.0])
    return np.concatenate([lower - shift, upper + shift])


def _with_probabilities(points: Floats, shares: Floats) -> Problem:
    return Problem(points, np.zeros(3), shares=shares, rests=len(shares))


def _with_equal_facets(points: Floats, facets: int) -> Problem:
    return _with_probabilities(points, np.full(facets, 1.0 / facets))


GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0

TRIBONACCI = 1.8392867552141612
"""Root of x^3 = x^2 + x + 1."""

SNUB = (0.67445914340362578, -0.3378432832477094, 0.65648060126987406)
"""Corner of the snub dodecahedron: equally far from its images by a fifth, a third and a half of a
turn, under scipy's rotations of the icosahedron."""

EVEN = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
"""Cyclic permutations of three coordinates."""

ANY = tuple(permutations(range(3)))


def _spread(*corners: tuple[float, float, float], orders: tuple[tuple[int, ...], ...]) -> Floats:
    """All sign changes and the given permutations of points, each once."""
    signs = np.array(list(product([-1.0, 1.0], repeat=3)))
    rows = [s * np.array(corner)[list(o)] for corner in corners for o in orders for s in signs]
    return np.unique(np.array(rows) + 0.0, axis=0)


_G2, _R2 = GOLDEN * GOLDEN, np.sqrt(2.0)

PLATONIC = {
    "tetrahedron": np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    "cube": _spread((1, 1, 1), orders=EVEN),
    "octahedron": _spread((1, 0, 0), orders=EVEN),
    "dodecahedron": np.concatenate(
        [_spread((1, 1, 1), orders=EVEN), _spread((0, 1 / GOLDEN, GOLDEN), orders=EVEN)]
    ),
    "icosahedron": _spread((0, 1, GOLDEN), orders=EVEN),
}

ARCHIMEDEAN = {
    "truncated tetrahedron": np.array(
        [p for p in _spread((1, 1, 3), orders=ANY).tolist() if np.prod(p) > 0]
    ),
    "cuboctahedron": _spread((1, 1, 0), orders=EVEN),
    "truncated cube": _spread((1, 1, _R2 - 1), orders=EVEN),
    "truncated octahedron": _spread((0, 1, 2), orders=ANY),
    "rhombicuboctahedron": _spread((1, 1, 1 + _R2), orders=EVEN),
    "truncated cuboctahedron": _spread((1, 1 + _R2, 1 + 2 * _R2), orders=ANY),
    "snub cube": Rotation.create_group("O").apply([1.0, 1.0 / TRIBONACCI, TRIBONACCI]),
    "icosidodecahedron": _spread((0, 0, 2 * GOLDEN), (1, GOLDEN, _G2), orders=EVEN),
    "truncated dodecahedron": _spread(
        (0, 1 / GOLDEN, 2 + GOLDEN), (1 / GOLDEN, GOLDEN, 2 * GOLDEN), (GOLDEN, 2, _G2), orders=EVEN
    ),
    "truncated icosahedron": _spread(
        (0, 1, 3 * GOLDEN), (1, 2 + GOLDEN, 2 * GOLDEN), (GOLDEN, 2, _G2 * GOLDEN), orders=EVEN
    ),
    "rhombicosidodecahedron": _spread(
        (1, 1, _G2 * GOLDEN), (_G2, GOLDEN, 2 * GOLDEN), (2 + GOLDEN, 0, _G2), orders=EVEN
    ),
    "truncated icosidodecahedron": _spread(
        (1 / GOLDEN, 1 / GOLDEN, 3 + GOLDEN),
        (2 / GOLDEN, GOLDEN, 1 + 2 * GOLDEN),
        (1 / GOLDEN, _G2, 3 * GOLDEN - 1),
        (2 * GOLDEN - 1, 2, 2 + GOLDEN),
        (GOLDEN, 3, 2 * GOLDEN),
        orders=EVEN,
    ),
    "snub dodecahedron": Rotation.create_group("I").apply(SNUB),
}

PLATONIC_FACETS = {
    "tetrahedron": 4,
    "cube": 6,
    "octahedron": 8,
    "dodecahedron": 12,
    "icosahedron": 20,
}
"""Number of facets of each."""

ARCHIMEDEAN_FACETS = {
    "truncated tetrahedron": {3: 4, 6: 4},
    "cuboctahedron": {3: 8, 4: 6},
    "truncated cube": {3: 8, 8: 6},
    "truncated octahedron": {4: 6, 6: 8},
    "rhombicuboctahedron": {3: 8, 4: 18},
    "truncated cuboctahedron": {4: 12, 6: 8, 8: 6},
    "snub cube": {3: 32, 4: 6},
    "icosidodecahedron": {3: 20, 5: 12},
    "truncated dodecahedron": {3: 20, 10: 12},
    "truncated icosahedron": {5: 12, 6: 20},
    "rhombicosidodecahedron": {3: 20, 4: 30, 5: 12},
    "truncated icosidodecahedron": {4: 30, 6: 20, 10: 12},
    "snub dodecahedron": {3: 80, 5: 12},
}
"""Number of facets with 3, 4, ... corners of each."""
