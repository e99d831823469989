"""Symmetric solids whose resting probabilities have a closed form.

Where all corners lie on a sphere around the center of mass and all facets are stable, a facet's
probability is its share of the solid angle. Where symmetry maps any facet to any other one, all
probabilities are equal.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as Triangulation

from dicedesign.bench.problem import Problem
from dicedesign.bench.uniform import ARCHIMEDEAN, ARCHIMEDEAN_FACETS, PLATONIC, PLATONIC_FACETS

__all__ = [
    "antiprism",
    "archimedean",
    "bipyramid",
    "box",
    "catalan",
    "icosphere",
    "platonic",
    "prism",
]

Floats = NDArray[np.float64]

HALF_TURNS = tuple(np.diag(s) for s in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1]))
CYCLES = (np.eye(3)[[1, 2, 0]], np.eye(3)[[2, 0, 1]])


def platonic(name: str) -> Problem:
    """A Platonic solid, all of whose facets are alike."""
    return _alike(PLATONIC[name], PLATONIC_FACETS[name])


def archimedean(name: str) -> Problem:
    """An Archimedean solid: regular facets with corners on a sphere."""
    points, facets = ARCHIMEDEAN[name], ARCHIMEDEAN_FACETS[name]
    distances = np.sqrt(((points[1:] - points[0]) ** 2).sum(-1))
    edge = float(distances.min() / np.sqrt((points[0] ** 2).sum()))
    shares = [np.full(count, regular_share(k, edge)) for k, count in facets.items()]
    return _known(points, np.concatenate(shares))


def catalan(name: str) -> Problem:
    """The dual of an Archimedean solid, all of whose facets are alike."""
    points = ARCHIMEDEAN[name]
    planes = Triangulation(points).equations
    corners = -planes[:, :3] / planes[:, 3:]
    return _alike(corners, len(points))


def prism(sides: int, height: float = 1.0) -> Problem:
    """An upright prism over a regular polygon of circumradius 1."""
    points = _stacked(_ring(sides), _ring(sides), height)
    edge = 2.0 * np.sin(np.pi / sides) / np.sqrt(1.0 + height * height / 4.0)
    base = regular_share(sides, edge)
    return _known(points, np.array([base, base, *[(0.5 - base) * 2.0 / sides] * sides]))


def antiprism(sides: int) -> Problem:
    """The antiprism with regular facets, over a polygon of circumradius 1."""
    edge = 2.0 * np.sin(np.pi / sides)
    height = np.sqrt(edge * edge - 4.0 * np.sin(np.pi / (2.0 * sides)) ** 2)
    points = _stacked(_ring(sides), _ring(sides, 0.5), height)
    base = regular_share(sides, edge / np.sqrt(1.0 + height * height / 4.0))
    return _known(points, np.array([base, base, *[(0.5 - base) / sides] * (2 * sides)]))


def bipyramid(sides: int, height: float = 1.0) -> Problem:
    """Two pyramids of a height on a regular polygon of circumradius 1."""
    return _alike(
        np.concatenate([_ring(sides), [[0.0, 0.0, height], [0.0, 0.0, -height]]]), 2 * sides
    )


def box(a: float, b: float, c: float) -> Problem:
    """A box with edges a, b, c along the axes."""
    points = np.array(list(product([-0.5, 0.5], repeat=3))) * [a, b, c]
    shares = []
    for x, y, z in ((a, b, c), (b, c, a), (c, a, b)):
        shares += [float(np.arctan2(x * y, z * np.sqrt(x * x + y * y + z * z)) / np.pi)] * 2
    return _known(points, np.array(shares))


def icosphere(subdivisions: int) -> Problem:
    """An icosahedron whose triangles are split into four, with all corners put on the sphere,
    several times. Its coordinates keep the symmetry of a tetrahedron without rounding."""
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
    """Part of the sphere that a regular polygon covers whose corners lie on it.

    corners: how many; edge: its edge over the sphere's radius. The polygon falls into right-angled
    triangles with legs x, y and the area 2 atan(tan(x / 2) tan(y / 2)).
    """
    y = np.arcsin(edge / 2.0)
    to_corner = np.arcsin(np.sin(y) / np.sin(np.pi / corners))
    x = np.arctan(np.tan(to_corner) * np.cos(np.pi / corners))
    return float(corners * np.arctan(np.tan(x / 2.0) * np.tan(y / 2.0)) / np.pi)


def _ring(sides: int, offset: float = 0.0) -> Floats:
    """(sides, 3) corners of a regular polygon in the plane z = 0, turned by parts of a side."""
    angles = 2.0 * np.pi * (np.arange(sides) + offset) / sides
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])


def _stacked(lower: Floats, upper: Floats, height: float) -> Floats:
    shift = np.array([0.0, 0.0, height / 2.0])
    return np.concatenate([lower - shift, upper + shift])


def _known(points: Floats, shares: Floats) -> Problem:
    return Problem(points, np.zeros(3), shares=shares, rests=len(shares))


def _alike(points: Floats, facets: int) -> Problem:
    return _known(points, np.full(facets, 1.0 / facets))
