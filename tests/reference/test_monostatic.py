"""Uniform bodies that rest on one facet only, and a proof of it in rational arithmetic."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from tests.reference.measurement import OK, measure, verdict
from tests.reference.monostatic import HALF_SPACES, OFFSET, conway_guy, half_spaces, unistable
from tests.reference.problem import turned

BODIES = {19: conway_guy(), 18: unistable(18), 14: unistable(14)}
"""By their number of facets."""


def cones(planes: Any) -> list[tuple[tuple[int, ...], Any, Any]]:
    """The corners (3,) of planes @ x <= OFFSET, by the three planes on which each lies, and the
    cross products (3, 3) of these, in fractions."""
    found = []
    for triple in combinations(range(len(planes)), 3):
        a, b, c = planes[list(triple)]
        along = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
        corner = along.sum(axis=0) * Fraction(OFFSET, a @ along[0])
        excess = (planes @ corner - OFFSET).tolist()
        if max(excess) <= 0:
            assert excess.count(0) == 3
            found.append((triple, corner, along))
    return found


def centroid(planes: Any) -> Any:
    """(3,) of a polyhedron with three facets at every corner. Brion: the integral of exp(t x) over
    it is the sum of those over the cones at its corners; the powers t^0 and t^1 give volume and
    moment."""
    volume = moment = np.zeros(3, dtype=object)
    for triple, corner, along in cones(planes):
        inward = -1 if planes[triple[0]] @ along[0] > 0 else 1
        size = Fraction(abs(along[0] @ np.cross(along[1], along[2])))
        cone = size / -(inward * along.prod(axis=0))
        volume = volume + cone * corner**3 / 6
        moment = moment + cone * corner**4 / 24
    assert volume[0] == volume[1] == volume[2] > 0
    return moment / volume


@pytest.mark.parametrize("facets", HALF_SPACES)
def test_one_rest_in_rational_arithmetic(facets: int) -> None:
    planes = half_spaces(facets).astype(object)
    assert len({plane for triple, *_ in cones(planes) for plane in triple}) == facets
    heights = OFFSET - planes @ centroid(planes)
    assert heights.min() > 0
    leads = []
    for facet, plane in enumerate(planes):
        foot = plane * (heights[facet] / Fraction(plane @ plane))
        leads.append(max(np.delete(planes @ foot / heights - 1, facet)))
    # The facets by which it rests and tips, and how clearly it does.
    assert leads[0] < Fraction(-1, 10)
    assert min(leads[1:]) > Fraction({18: 14, 14: 4}[facets], 1000)
    exact = np.array(sorted(corner.tolist() for _, corner, _ in cones(planes)), dtype=np.float64)
    found = unistable(facets).points
    assert found.shape == (2 * facets - 4, 3)
    np.testing.assert_allclose(found[np.lexsort(found.T[::-1])], exact, rtol=0, atol=1e-11)


@pytest.mark.parametrize("facets", BODIES)
def test_one_rest_takes_all_in_any_orientation(facets: int) -> None:
    found = measure(BODIES[facets])
    assert (found.facets, found.rests, found.tied) == (facets, 1, False)
    assert found.errors == {"closed form": 0.0, "oracle": 0.0}
    assert found.probabilities == (1.0,)
    for seed in range(5):
        found = measure(turned(BODIES[facets], seed), oracle=seed < 2)
        assert verdict(found, rests=1) == OK
