"""Suite of stiff and extreme bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull as Triangulation

from tests.reference import extremes, solids, stiff
from tests.reference.problem import Case, Problem, case
from tests.reference.solids import ARCHIMEDEAN, PLATONIC

TURNS = 20
"""Random orientations of every symmetric solid."""

SIDES = range(3, 65)
"""Sides of the prisms, antiprisms and bipyramids."""

QUICK_SIDES = (3, 4, 5, 6, 7, 12, 17, 32, 64)
"""Sides in the short suite."""


def body_cases() -> list[Case]:
    """All bodies, with unique names."""
    families = {
        "symmetric": _symmetric,
        "flat angles, needles, plates": _degenerate,
        "barely balanced": _balanced_cases,
        "tiny, huge, far away": _placed_cases,
        "one rest or few": _few_rests,
        "large": _large,
        "untidy points": _inputs,
    }
    return [replace(case, kind=kind) for kind, family in families.items() for case in family()]


def _symmetric() -> Iterator[Case]:
    for name in PLATONIC:
        yield case(solids.platonic, name, turns=TURNS)
    for build, name in product((solids.archimedean, solids.catalan), ARCHIMEDEAN):
        yield case(build, name, turns=TURNS)
    for build, n in product((solids.prism, solids.antiprism, solids.bipyramid), SIDES):
        yield case(build, n, turns=TURNS, quick=n in QUICK_SIDES)
    for k in range(4):
        yield case(solids.icosphere, k, turns=TURNS)
    for k in (4, 5):
        yield case(solids.icosphere, k, points=10 * 4**k + 2, quick=False)
    for edges in ((1.0, 1.0, 1.0), (1.0, 1.0, 9.0), (1.0, 2.0, 3.0), (5.0, 4.0, 0.1)):
        yield case(solids.box, *edges, turns=TURNS)


def _degenerate() -> Iterator[Case]:
    for tolerance in (None, 0.0):
        for power in (*range(2, 15, 2), 15):
            for centered in (True, False):
                yield case(stiff.roof, 10.0**-power, centered=centered, tolerance=tolerance)
        for build, power in product((stiff.bulging_cube, stiff.dented_cube), range(3, 16, 2)):
            yield case(build, 10.0**-power, tolerance)
    for height in (1e6, 1e-6):
        yield case(solids.box, 1.0, 1.0, height, turns=TURNS)
        yield case(_uniform_box, 1.0, 1.0, height, turns=TURNS)
        for seed in range(4):
            yield case(stretched_body, seed, (1.0, 1.0, height), turns=TURNS)
    for power in range(2, 15):
        yield case(stiff.glancing, 10.0**-power)


def _uniform_box(a: float, b: float, c: float) -> Problem:
    return replace(solids.box(a, b, c), center=None)


def _balanced_cases() -> Iterator[Case]:
    for power, facets in product(range(3, 14, 2), (1, 2, 3)):
        yield case(stiff.hidden_center, 10.0**-power, facets)
    sides = (sign * 10.0**-power for power in range(3, 14) for sign in (1.0, -1.0))
    for distance, corner in product((0.0, *sides), (False, True)):
        yield case(stiff.off_balance, distance, corner=corner)
    for distance in (0.0, *(10.0**-power for power in range(1, 15))):
        yield case(stiff.opposed_corner, distance)
    for seed in range(20):
        yield case(lattice_body, seed)


def _placed_cases() -> Iterator[Case]:
    for name, size, distance in product(PLACED, (1e-9, 1e9), (0.0,)):
        yield case(_placed, name, size, distance)
    for name in PLACED:
        yield case(_placed, name, 1.0, 1e7)


PLACED = {
    "dodecahedron": solids.platonic("dodecahedron"),
    "box": solids.box(1.0, 2.0, 3.0),
    "random body": stiff.random_body(0),
}


def _placed(name: str, size: float, distance: float) -> Problem:
    return stiff.place(PLACED[name], size, distance)


def _few_rests() -> Iterator[Case]:
    for build in (extremes.conway_guy, weighted_sphere, extremes.lens):
        yield case(build, turns=TURNS)
    for facets in (18, 14):
        yield case(extremes.unistable, facets, turns=TURNS)
    for seed in extremes.ANTIPODE_SEEDS:
        yield case(extremes.lopsided_needle, seed)


def _large() -> Iterator[Case]:
    for points, rings, sides in ((10**3, 10, 12), (10**4, 32, 39), (10**5, 100, 125)):
        quick = points == 10**3
        yield case(extremes.large, points, points=points, quick=quick)
        yield case(globe, rings, sides, points=points, quick=quick)
    yield case(solids.prism, 500, points=1000)
    yield case(solids.prism, 5000, points=10_000, quick=False)


def _inputs() -> Iterator[Case]:
    yield case(_with_duplicates, turns=TURNS)
    yield case(_with_extras, turns=TURNS)
    yield case(with_unreferenced, turns=TURNS)
    yield case(_with_interior, 10**6, points=10**6, quick=False)


def weighted_sphere() -> Problem:
    """A sphere of 1280 triangles with its center of mass near a corner of a facet: one rest."""
    points = solids.icosphere(3).points
    triangle = points[Triangulation(points).simplices[0]]
    inner = 0.85 * triangle[0] + 0.15 * triangle.mean(axis=0)
    return Problem(points, 0.97 * inner, shares=np.ones(1), rests=1)


def globe(rings: int, sides: int) -> Problem:
    """Points of a sphere on circles of latitude, 8 x rings x sides in all: facets are trapezoids,
    and the coordinates have the symmetry of a box without rounding."""
    latitude = 0.5 * np.pi * (np.arange(rings) + 0.5)[:, None] / rings
    longitude = 0.5 * np.pi * (np.arange(sides) + 0.5)[None, :] / sides
    octant = np.stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude) + 0.0 * longitude,
        ],
        axis=-1,
    ).reshape(-1, 3)
    points = np.concatenate([octant * signs for signs in product([-1.0, 1.0], repeat=3)])
    mirrors = tuple(np.diag(s) for s in ([-1.0, 1, 1], [1.0, -1, 1], [1.0, 1, -1]))
    return Problem(points, np.zeros(3), symmetries=mirrors)


def with_unreferenced() -> Problem:
    """A box as a mesh, with points far outside on no triangle."""
    problem = solids.box(1.0, 2.0, 3.0)
    points = np.concatenate([[[9.0, 9.0, 9.0], [-7.0, 0.0, 0.0]], problem.points])
    triangles = Triangulation(problem.points).simplices.astype(np.int64) + 2
    return replace(problem, points=points, triangles=triangles, center=None)


def stretched_body(seed: int, factors: tuple[float, float, float]) -> Problem:
    """A random body stretched along the axes."""
    return Problem(stiff.random_body(seed).points * factors)


def lattice_body(seed: int) -> Problem:
    """A body with small integer coordinates, which balances in many ways."""
    rng = np.random.default_rng(seed)
    while True:
        points = rng.integers(-2, 3, size=(8, 3)).astype(np.float64)
        if np.linalg.matrix_rank(points - points[0]) == 3:
            hull = Triangulation(points)
            if (hull.equations[:, 3] < 0.0).all():
                return Problem(points, np.zeros(3))


def _with_duplicates() -> Problem:
    return replace(extremes.with_repeats(solids.box(1.0, 2.0, 3.0), 0), center=None)


def _with_extras() -> Problem:
    on_edges = extremes.with_extras(solids.platonic("icosahedron"), 0, 200, "edge")
    return extremes.with_extras(on_edges, 1, 200, "facet")


def _with_interior(count: int) -> Problem:
    return extremes.with_extras(solids.platonic("dodecahedron"), 0, count, "inside")
