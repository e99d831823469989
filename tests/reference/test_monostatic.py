"""Uniform bodies that rest on one facet only, and a proof of it in rational arithmetic."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest

from tests.reference.measurement import OK, measure, verdict
from tests.reference.monostatic import HALF_SPACES, OFFSET, conway_guy, unistable
from tests.reference.problem import turned

Vector = tuple[Fraction, ...]

BODIES = {
    "Conway-Guy 19-facet unistable": (19, conway_guy()),
    "unistable polyhedron with 18 facets": (18, unistable(18)),
    "unistable polyhedron with 14 facets": (14, unistable(14)),
}


def dot(a: Vector, b: Vector) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def cross(a: Vector, b: Vector) -> Vector:
    return tuple(a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3))


def corners(planes: list[Vector]) -> dict[tuple[int, ...], Vector]:
    """The corners of a x + b y + c z <= OFFSET by the three planes on which each lies."""
    found = {}
    for triple in combinations(range(len(planes)), 3):
        a, b, c = (planes[i] for i in triple)
        determinant = dot(a, cross(b, c))
        sides = zip(cross(b, c), cross(c, a), cross(a, b), strict=True)
        corner = tuple(OFFSET * sum(side) / determinant for side in sides)
        excess = [dot(plane, corner) - OFFSET for plane in planes]
        if max(excess) <= 0:
            assert excess.count(Fraction(0)) == 3
            found[triple] = corner
    return found


def centroid(planes: list[Vector]) -> Vector:
    """Of a polyhedron with three facets at every corner. Brion: the integral of exp(t x) over it is
    the sum of those over the cones at its corners; the powers t^0 and t^1 give volume and moment.
    """
    volume, moment = [Fraction(0)] * 3, [Fraction(0)] * 3
    for triple, corner in corners(planes).items():
        a, b, c = (planes[i] for i in triple)
        along = [cross(b, c), cross(c, a), cross(a, b)]
        inward = -1 if dot(a, cross(b, c)) > 0 else 1
        size = abs(dot(along[0], cross(along[1], along[2])))
        for axis in range(3):
            cone = size / -(inward * along[0][axis] * along[1][axis] * along[2][axis])
            volume[axis] += cone * corner[axis] ** 3 / 6
            moment[axis] += cone * corner[axis] ** 4 / 24
    assert volume[0] == volume[1] == volume[2] > 0
    return tuple(m / volume[0] for m in moment)


@pytest.mark.parametrize("facets", HALF_SPACES)
def test_one_rest_in_rational_arithmetic(facets: int) -> None:
    planes = [tuple(Fraction(x) for x in row) for row in HALF_SPACES[facets]]
    touched = {plane for triple in corners(planes) for plane in triple}
    assert len(touched) == len(planes) == facets
    center = centroid(planes)
    heights = [OFFSET - dot(plane, center) for plane in planes]
    leads = []
    for plane, height in zip(planes, heights, strict=True):
        foot = [x * height / dot(plane, plane) for x in plane]
        others = zip(planes, heights, strict=True)
        leads.append(max(dot(foot, p) / h - 1 for p, h in others if p != plane))
    assert min(heights) > 0
    # The facets by which it rests and tips, and how clearly it does.
    assert leads[0] < Fraction(-1, 10)
    assert min(leads[1:]) > Fraction({18: 14, 14: 4}[facets], 1000)


@pytest.mark.parametrize("facets", HALF_SPACES)
def test_corners_are_those_of_the_half_spaces(facets: int) -> None:
    planes = [tuple(Fraction(x) for x in row) for row in HALF_SPACES[facets]]
    exact = np.array(sorted(corners(planes).values()), dtype=np.float64)
    found = unistable(facets).points
    assert found.shape == (2 * facets - 4, 3)
    np.testing.assert_allclose(found[np.lexsort(found.T[::-1])], exact, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", BODIES)
def test_one_rest_takes_all(name: str) -> None:
    facets, problem = BODIES[name]
    found = measure(problem)
    assert (found.facets, found.rests, found.tied) == (facets, 1, False)
    assert found.errors == {"closed form": 0.0, "oracle": 0.0}
    assert found.probabilities == (1.0,)


@pytest.mark.parametrize("name", BODIES)
def test_one_rest_in_any_orientation(name: str) -> None:
    for seed in range(5):
        found = measure(turned(BODIES[name][1], seed), oracle=seed < 2)
        assert verdict(found, rests=1) == OK
