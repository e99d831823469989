"""Convex regions for a center of mass."""

from __future__ import annotations

import numpy as np
import pytest
from common.boxes import box

from dicedesign.balance.center.regions import Halfspaces, box_region, points_within
from dicedesign.errors import InputError
from dicedesign.geometry.hulls.hull import convex_hull


def test_what_two_boxes_have_in_common() -> None:
    one = box_region(np.array([0.0, 0.0, 0.0]), np.array([2.0, 2.0, 2.0]))
    other = box_region(np.array([1.0, -1.0, 1.5]), np.array([3.0, 1.0, 4.0]))
    common = one.and_within(other).corners()
    assert common is not None
    np.testing.assert_allclose(common.vertices.min(axis=0), [1.0, 0.0, 1.5], atol=1e-12)
    np.testing.assert_allclose(common.vertices.max(axis=0), [2.0, 1.0, 2.0], atol=1e-12)
    place, depth = one.and_within(other).deepest
    assert depth == pytest.approx(0.25)
    assert place[2] == pytest.approx(1.75)


def test_boxes_apart_have_nothing_in_common() -> None:
    one = box_region(np.zeros(3), np.ones(3))
    other = box_region(np.full(3, 2.0), np.full(3, 3.0))
    assert one.and_within(other).corners() is None


@pytest.mark.parametrize("high", [(1.0, 0.0, 1.0), (1.0, np.nan, 1.0)])
def test_what_is_no_box(high: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="region: expected a box"):
        box_region(np.zeros(3), np.array(high))


def test_points_fill_a_hull_evenly() -> None:
    hull = convex_hull(box((1.0, 2.0, 3.0), (1.0, 0.0, 0.0)).points)
    points = points_within(hull, 4000)
    assert (hull.depths(points) >= -1e-12).all()
    np.testing.assert_allclose(points.mean(axis=0), hull.centroid, atol=0.02)
    # Second moments of the leaning box: those of its height, and of its width and lean.
    np.testing.assert_allclose(np.var(points[:, 2]), 9.0 / 12.0, rtol=0.02)
    np.testing.assert_allclose(np.var(points[:, 0]), 2.0 / 12.0, rtol=0.03)
    assert np.array_equal(points, points_within(hull, 4000))
    assert (Halfspaces.of_hull(hull).heights(hull.centroid) > 0.0).all()
