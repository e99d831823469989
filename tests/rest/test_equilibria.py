"""Classification of facets, edges and vertices, on bodies where it is known."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from dicedesign.errors import InputError, OutsideHullError
from dicedesign.geometry.hulls.hull import convex_hull
from dicedesign.rest.equilibria import classify

CUBE = np.array(list(product([-1.0, 1.0], repeat=3)))


def test_a_cube_rests_on_facets_balances_on_corners_and_tips_over_edges() -> None:
    cube = classify(convex_hull(CUBE), [0, 0, 0])
    assert cube.stable.all()
    assert cube.maximum.all()
    assert cube.saddle.sum() == 2 * 12
    assert cube.hinge.all()
    lengths = np.linalg.norm(cube.saddle_directions, axis=1)
    unit = np.abs(cube.saddle_directions / lengths[:, None])
    np.testing.assert_allclose(np.sort(unit, axis=1), [[0, 0.5**0.5, 0.5**0.5]] * 24, atol=1e-15)


@pytest.mark.parametrize(
    "center", [[0.0, 0.0], [0.0, np.nan, 0.0], [0.0, 0.0, np.inf], [[0.0] * 3]]
)
def test_a_center_is_three_finite_numbers(center: list[float]) -> None:
    with pytest.raises(InputError, match="center of mass"):
        classify(convex_hull(CUBE), center)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_center_has_to_be_inside_whatever_the_size(size: float) -> None:
    hull = convex_hull(size * CUBE)
    for x, where in ((1.0 - 1e-14, "on the boundary"), (1.0 + 1e-14, "boundary"), (1.1, "outside")):
        with pytest.raises(OutsideHullError, match=where):
            classify(hull, [0.0, size * x, 0.0])
    classify(hull, [0.0, size * (1.0 - 1e-12), 0.0])


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_edges_are_hinges_where_the_foot_is_between_their_ends(shift: float) -> None:
    hull = convex_hull(CUBE * [1.0, 2.0, 3.0])
    center = np.array([0.0, shift, -shift])
    body = classify(hull, center)
    a, b = hull.vertices[hull.tail], hull.vertices[hull.head]
    t = ((center - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1)
    np.testing.assert_array_equal(body.hinge, (t > 0) & (t < 1))
