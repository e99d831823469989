"""Least values of quadratic functions within convex bodies."""

from __future__ import annotations

import numpy as np
import pytest

from dicedesign.concave.hollow.least_within import least_within
from dicedesign.geometry.hulls.hull import convex_hull


@pytest.mark.parametrize("seed", range(8))
def test_no_way_into_the_region_goes_downhill(seed: int) -> None:
    random = np.random.default_rng(seed)
    region = convex_hull(random.normal(size=(20, 3)) + 0.2)
    root = random.normal(size=(3, 3))
    form, slope = root @ root.T, 3.0 * random.normal(size=3)
    least = least_within(form, slope, region.normals, region.heights(np.zeros(3)))
    assert region.depths(least[None]).min() >= -1e-9
    # Of a convex function, that is what makes a place the least.
    assert ((region.vertices - least) @ (form @ least + slope)).min() >= -1e-7


def test_a_region_that_is_large_enough_does_not_matter() -> None:
    form, slope = np.diag([1.0, 2.0, 4.0]), np.array([0.3, -0.2, 0.1])
    region = convex_hull([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    expected = [-0.3, 0.1, -0.025]
    np.testing.assert_allclose(
        least_within(form, slope, region.normals, region.heights(np.zeros(3))), expected, rtol=1e-7
    )
