"""Hypothesis strategies for bodies of every kind, easy and hard.

Each draws a builder of reference bodies and a few numbers, and applies steps from `bodies`. A
failing example is printed as the calls that make it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bodies import (
    ON,
    cloud,
    glancing_edge,
    globe_with_weight,
    lattice,
    overhanging,
    squeeze,
    with_center_near_surface,
    with_noise,
    with_random_center,
)
from hypothesis import strategies as st

from tests.reference import extremes, solids, stiff
from tests.reference.problem import Problem, rotate_problem
from tests.reference.solids import ARCHIMEDEAN, PLATONIC

Problems = st.SearchStrategy[Problem]

SEEDS = st.integers(0, 10**6)

TOLERANCES = st.sampled_from([None, 0.0])
"""The default tolerance, and none."""


def powers(least: float, most: float) -> st.SearchStrategy[float]:
    """10^x for quarters x of an integer in a range."""
    quarters = st.integers(round(4 * least), round(4 * most))
    return quarters.map(lambda quarter: float(10.0 ** (quarter / 4)))


def rotate(problem: Problem, seed: int) -> Problem:
    """A problem in a random orientation. Corners are rounded: at tolerance 0 facets then break, and
    the known number of rests is dropped."""
    exact = problem.coplanar_tolerance == 0.0
    return rotate_problem(replace(problem, rests=None) if exact else problem, seed)


def place(problem: Problem, size: float, distance: float) -> Problem:
    """A problem scaled and moved. Corners are rounded; far from the origin the known probabilities
    are dropped. See `rotate`."""
    exact = problem.coplanar_tolerance == 0.0
    moved = stiff.place(replace(problem, rests=None) if exact else problem, size, distance)
    return replace(moved, shares=None) if distance > 0.0 else moved


def maybe(problems: Problems, *steps: Problems) -> Problems:
    """The problems as they are, or after one of some steps, equally often. (`one_of` would count
    the kinds of problems one by one.)"""
    choices = (problems, *steps)
    return st.integers(0, len(steps)).flatmap(choices.__getitem__)


def turns(problems: Problems) -> Problems:
    """Unrotated or rotated."""
    return maybe(problems, st.builds(rotate, problems, SEEDS))


def symmetric() -> Problems:
    """Platonic, Archimedean and Catalan solids, prisms, antiprisms, bipyramids, boxes, icospheres,
    unrotated and rotated."""
    edges = powers(-1.0, 1.0)
    solid = st.one_of(
        st.builds(solids.platonic, st.sampled_from(sorted(PLATONIC))),
        st.builds(solids.box, edges, edges, edges),
        st.builds(solids.prism, st.integers(3, 24), powers(-1.0, 1.0)),
        st.builds(solids.antiprism, st.integers(3, 24)),
        st.builds(solids.bipyramid, st.integers(3, 24)),
        st.builds(solids.archimedean, st.sampled_from(sorted(ARCHIMEDEAN))),
        st.builds(solids.catalan, st.sampled_from(sorted(ARCHIMEDEAN))),
        st.builds(solids.icosphere, st.integers(0, 1)),
    )
    return turns(solid)


def clouds() -> Problems:
    """Random and lattice points: 4 to 60."""
    whole = st.integers(-3, 3)
    corners = st.lists(st.tuples(whole, whole, whole), min_size=4, max_size=30, unique=True)
    shapes = st.sampled_from(["normal", "sphere", "cube", "walls"])
    return st.one_of(
        st.builds(lattice, corners, TOLERANCES), st.builds(cloud, SEEDS, st.integers(4, 60), shapes)
    )


def add_points_and_noise(problems: Problems) -> Problems:
    """With duplicates, collinear, coplanar and interior points, with noise of 1e-16 to 1e-10, with
    another center of mass."""
    extras = st.builds(
        extremes.with_extras,
        problems,
        SEEDS,
        st.integers(1, 20),
        st.sampled_from(["facet", "edge", "inside"]),
    )
    repeats = st.builds(extremes.with_repeats, problems, SEEDS)
    crowded = maybe(problems, extras, repeats)
    noisy = maybe(crowded, st.builds(with_noise, crowded, SEEDS, st.integers(-16, -10)))
    return maybe(noisy, st.builds(with_random_center, noisy, SEEDS))


def near_degenerate() -> Problems:
    """Nearly flat, nearly coplanar, nearly balanced, and with glancing crossings."""
    tiny, near = powers(-15.0, -2.0), powers(-13.0, -3.0)
    signed = st.one_of(tiny, tiny.map(lambda x: -x))
    on = st.sampled_from(ON)
    base = turns(st.one_of(clouds(), symmetric().map(_plain)))
    off_center = maybe(base, st.builds(with_random_center, base, SEEDS))
    shapes = st.one_of(
        st.builds(stiff.roof, tiny, centered=st.booleans(), tolerance=TOLERANCES),
        st.builds(stiff.bulging_cube, tiny, TOLERANCES),
        st.builds(stiff.dented_cube, tiny, TOLERANCES),
        st.builds(stiff.glancing, signed),
        st.builds(stiff.opposed_corner, signed),
        st.builds(stiff.hidden_center, near, st.integers(1, 3)),
        st.builds(stiff.off_balance, signed, corner=st.booleans()),
    )
    powers_of_ten = st.tuples(st.integers(-6, 0), st.integers(-6, 6)).filter(
        lambda both: max(*both, 0) - min(*both, 0) <= 6
    )
    return st.one_of(
        turns(shapes),
        turns(st.builds(squeeze, off_center, powers_of_ten)),
        st.builds(with_center_near_surface, base, SEEDS, near, on),
        st.builds(overhanging, base, SEEDS, st.one_of(signed, st.just(0.0)), on),
        st.builds(glancing_edge, base, SEEDS, signed),
    )


def few_rests() -> Problems:
    """Spheres with a weight near their surface, lenses, needles, the Conway-Guy polyhedron."""
    shapes = st.one_of(
        st.builds(globe_with_weight, st.integers(0, 1), SEEDS, powers(-6.0, 0.0)),
        st.builds(extremes.lens),
        st.builds(extremes.lopsided_needle, SEEDS),
        st.builds(extremes.lopsided_needle, st.sampled_from(extremes.ANTIPODE_SEEDS)),
        st.builds(extremes.conway_guy, st.sampled_from([17, 19, 21]), powers(1.0, 1.5)),
    )
    return st.one_of(turns(shapes), turns(st.builds(with_random_center, shapes.map(_plain), SEEDS)))


def scaled_and_placed() -> Problems:
    """Any body at sizes of 1e-9 to 1e9, and up to 1e7 sizes away from the origin; not so far those
    that are so near a balance or the surface that the digits lost there decide about them."""
    robust = st.one_of(symmetric(), turns(add_points_and_noise(clouds())), few_rests())
    sizes = powers(-9.0, 9.0)
    return st.one_of(
        st.builds(place, near_degenerate(), sizes, st.just(0.0)),
        st.builds(place, robust, sizes, st.one_of(st.just(0.0), powers(0.0, 7.0))),
    )


def flat() -> Problems:
    """Lattice points on a plane through the origin, a line or a point, with and without
    tolerance."""
    whole = st.integers(-4, 4)
    vectors = st.tuples(whole, whole, whole)
    weights = st.lists(st.tuples(whole, whole), min_size=1, max_size=12)
    return st.builds(_span, vectors, vectors, weights, TOLERANCES)


def _span(
    a: tuple[int, int, int],
    b: tuple[int, int, int],
    weights: list[tuple[int, int]],
    tolerance: float | None,
) -> Problem:
    return Problem(np.array(weights) @ np.array([a, b], dtype=np.float64), None, None, tolerance)


def _plain(problem: Problem) -> Problem:
    """Only the points."""
    return Problem(problem.points)


KINDS = {
    "symmetric": symmetric(),
    "random and lattice clouds": turns(add_points_and_noise(clouds())),
    "nearly degenerate": near_degenerate(),
    "with few rests": few_rests(),
    "of any size anywhere": scaled_and_placed(),
}
