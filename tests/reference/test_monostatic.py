"""Uniform bodies that rest on one facet only, in any orientation, by closed form and oracle."""

from __future__ import annotations

import pytest

from tests.reference.measurement import OK, measure, verdict
from tests.reference.monostatic import conway_guy, unistable
from tests.reference.problem import rotate_problem

BODIES = {19: conway_guy(), 18: unistable(18), 14: unistable(14)}
"""By their number of facets."""


@pytest.mark.parametrize("facets", BODIES)
def test_one_rest_takes_all_in_any_orientation(facets: int) -> None:
    measurement = measure(BODIES[facets])
    assert (measurement.facets, measurement.rests, measurement.tied) == (facets, 1, False)
    assert measurement.errors == {"closed form": 0.0, "oracle": 0.0}
    assert measurement.probabilities == (1.0,)
    assert facets > 18 or BODIES[facets].points.shape == (2 * facets - 4, 3)
    for seed in range(5):
        measurement = measure(rotate_problem(BODIES[facets], seed), oracle=seed < 2)
        assert verdict(measurement, rests=1) == OK
