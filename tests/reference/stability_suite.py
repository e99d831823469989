"""Suite of stiff and extreme bodies and designs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from tests.reference import extremes, monostatic, solids, stiff, stiff_designs
from tests.reference.problem import Case
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
        yield Case(name, partial(solids.platonic, name), TURNS)
    for name in ARCHIMEDEAN:
        yield Case(name, partial(solids.archimedean, name), TURNS)
        yield Case(f"dual of {name}", partial(solids.catalan, name), TURNS)
    for n in SIDES:
        quick = n in QUICK_SIDES
        yield Case(f"prism {n}", partial(solids.prism, n), TURNS, quick=quick)
        yield Case(f"antiprism {n}", partial(solids.antiprism, n), TURNS, quick=quick)
        yield Case(f"bipyramid {n}", partial(solids.bipyramid, n), TURNS, quick=quick)
    for k in range(6):
        turns = TURNS if k < 4 else 0
        points = 10 * 4**k + 2 if k >= 4 else 0
        yield Case(f"icosphere {k}", partial(solids.icosphere, k), turns, points, quick=k < 4)
    for edges in ((1, 1, 1), (1, 1, 9), (1, 2, 3), (5, 4, 0.1)):
        name = " x ".join(f"{edge:g}" for edge in edges)
        yield Case(f"box {name}", partial(solids.box, *edges), TURNS)


def _degenerate() -> Iterator[Case]:
    for power in (*range(2, 15, 2), 15):
        for tolerance, how in ((None, ""), (0.0, ", tolerance 0")):
            for centered, where in ((True, ""), (False, " off center")):
                yield Case(
                    f"roof 1e-{power}{where}{how}",
                    partial(stiff.roof, 10.0**-power, centered=centered, tolerance=tolerance),
                )
    for power in range(3, 16, 2):
        for tolerance, how in ((None, ""), (0.0, ", tolerance 0")):
            yield Case(
                f"bulge 1e-{power}{how}", partial(stiff.bulging_cube, 10.0**-power, tolerance)
            )
            yield Case(f"dent 1e-{power}{how}", partial(stiff.dented_cube, 10.0**-power, tolerance))
    for name, height in (("needle 1e6", 1e6), ("plate 1e-6", 1e-6)):
        box = solids.box(1.0, 1.0, height)
        yield Case(f"box {name}", partial(replace, box), TURNS)
        yield Case(f"uniform box {name}", partial(replace, box, center=None), TURNS)
        for seed in range(4):
            stretched = partial(stiff.stretched_body, seed, (1.0, 1.0, height))
            yield Case(f"random {name} ({seed})", stretched, TURNS)
    for power in range(2, 15):
        yield Case(f"glancing crossing 1e-{power}", partial(stiff.glancing, 10.0**-power))


def _balanced_cases() -> Iterator[Case]:
    for power in range(3, 14, 2):
        for near, what in ((1, "a facet"), (2, "an edge"), (3, "a corner")):
            yield Case(
                f"center 1e-{power} from {what}", partial(stiff.hidden_center, 10.0**-power, near)
            )
    for power in range(3, 14):
        for sign, side in ((1.0, "inside"), (-1.0, "beyond")):
            distance = sign * 10.0**-power
            for corner, what in ((False, "an edge"), (True, "a corner")):
                yield Case(
                    f"foot 1e-{power} {side} {what}",
                    partial(stiff.off_balance, distance, corner=corner),
                )

    for corner, what in ((False, "an edge"), (True, "a corner")):
        yield Case(f"foot on {what}", partial(stiff.off_balance, 0.0, corner=corner))
    for power in range(1, 15):
        yield Case(
            f"corner 1e-{power} from opposite a rest", partial(stiff.opposed_corner, 10.0**-power)
        )
    yield Case("corner opposite a rest", partial(stiff.opposed_corner, 0.0))
    for seed in range(20):
        yield Case(f"lattice body ({seed})", partial(stiff.lattice_body, seed))


def _placed_cases() -> Iterator[Case]:
    for name, body in {
        "dodecahedron": solids.platonic("dodecahedron"),
        "box 1 x 2 x 3": solids.box(1.0, 2.0, 3.0),
        "random body": stiff.random_body(0),
    }.items():
        for place, size, distance in (
            ("at 1e-9", 1e-9, 0.0),
            ("at 1e9", 1e9, 0.0),
            ("1e7 sizes away", 1.0, 1e7),
        ):
            yield Case(f"{name} {place}", partial(stiff.place, body, size, distance))


def _few_rests() -> Iterator[Case]:
    yield Case("Conway-Guy 19-facet unistable", monostatic.conway_guy, TURNS)
    yield Case("unistable polyhedron with 18 facets", partial(monostatic.unistable, 18), TURNS)
    yield Case("unistable polyhedron with 14 facets", partial(monostatic.unistable, 14), TURNS)
    yield Case("weighted sphere", extremes.weighted_sphere, TURNS)
    yield Case("lens", extremes.lens, TURNS)
    for seed in extremes.ANTIPODE_SEEDS:
        yield Case(f"basin beyond a hemisphere ({seed})", partial(extremes.lopsided_needle, seed))


def _large() -> Iterator[Case]:
    for power, rings, sides in ((3, 10, 12), (4, 32, 39), (5, 100, 125)):
        points = 10**power
        quick = power == 3
        random, globe = partial(extremes.large, points), partial(extremes.globe, rings, sides)
        yield Case(f"random hull 1e{power}", random, 0, points, quick=quick)
        yield Case(f"globe 1e{power}", globe, 0, points, quick=quick)
    for n, quick in ((500, True), (5000, False)):
        yield Case(f"prism {n}", partial(solids.prism, n), 0, 2 * n, quick=quick)


def _inputs() -> Iterator[Case]:
    yield Case("duplicate points", extremes.with_duplicates, TURNS)
    yield Case("collinear and coplanar extras", extremes.with_extras, TURNS)
    yield Case("unreferenced vertices", extremes.with_unreferenced, TURNS)
    yield Case("1e6 interior points", extremes.with_interior, 0, 10**6, quick=False)
