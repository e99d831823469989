"""Suite of stiff and extreme bodies and designs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

from tests.reference import extremes, solids, stiff, stiff_designs
from tests.reference.problem import Case, Problem, case
from tests.reference.solids import ARCHIMEDEAN, PLATONIC

TURNS = 20
"""Random orientations of every symmetric solid."""

SIDES = range(3, 65)
"""Sides of the prisms, antiprisms and bipyramids."""

QUICK_SIDES = (3, 4, 5, 6, 7, 12, 17, 32, 64)
"""Sides in the short suite."""


def stability_cases() -> tuple[Case, ...]:
    """All cases, with unique names."""
    families = {
        "symmetric": _symmetric,
        "flat angles, needles, plates": _degenerate,
        "barely balanced": _balanced_cases,
        "tiny, huge, far away": _placed_cases,
        "one rest or few": _few_rests,
        "large": _large,
        "untidy points": _inputs,
    }
    bodies = [replace(case, kind=kind) for kind, family in families.items() for case in family()]
    return (*bodies, *stiff_designs.design_cases())


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
            yield case(stiff.stretched_body, seed, (1.0, 1.0, height), turns=TURNS)
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
        yield case(stiff.lattice_body, seed)


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
    for build in (extremes.conway_guy, extremes.weighted_sphere, extremes.lens):
        yield case(build, turns=TURNS)
    for facets in (18, 14):
        yield case(extremes.unistable, facets, turns=TURNS)
    for seed in extremes.ANTIPODE_SEEDS:
        yield case(extremes.lopsided_needle, seed)


def _large() -> Iterator[Case]:
    for points, rings, sides in ((10**3, 10, 12), (10**4, 32, 39), (10**5, 100, 125)):
        quick = points == 10**3
        yield case(extremes.large, points, points=points, quick=quick)
        yield case(extremes.globe, rings, sides, points=points, quick=quick)
    yield case(solids.prism, 500, points=1000)
    yield case(solids.prism, 5000, points=10_000, quick=False)


def _inputs() -> Iterator[Case]:
    yield case(_with_duplicates, turns=TURNS)
    yield case(_with_extras, turns=TURNS)
    yield case(extremes.with_unreferenced, turns=TURNS)
    yield case(_with_interior, 10**6, points=10**6, quick=False)


def _with_duplicates() -> Problem:
    return replace(extremes.with_repeats(solids.box(1.0, 2.0, 3.0), 0), center=None)


def _with_extras() -> Problem:
    on_edges = extremes.with_extras(solids.platonic("icosahedron"), 0, 200, "edge")
    return extremes.with_extras(on_edges, 1, 200, "facet")


def _with_interior(count: int) -> Problem:
    return extremes.with_extras(solids.platonic("dodecahedron"), 0, count, "inside")
